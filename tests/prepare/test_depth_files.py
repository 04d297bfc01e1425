"""Depth maps that are called as photos, before anything is placed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.errors import InputError
from room2dgs.prepare.photos import ChosenPhoto
from room2dgs.prepare.sources import depth_files


def photos(*names: str) -> list[ChosenPhoto]:
    return [ChosenPhoto(name, (40, 30), None, None, index, 1.0) for index, name in enumerate(names)]


def depth(folder, *names: str) -> None:
    for name in names:
        path = folder / name
        if path.suffix == ".npy":
            np.save(path, np.ones((30, 40), np.float32))
        else:
            cv2.imwrite(str(path), np.full((30, 40), 1000, np.uint16))


def test_maps_are_found_by_the_photos_names(tmp_path):
    depth(tmp_path, "a.png", "b.npy")
    assert depth_files(tmp_path, photos("a.jpg", "b.jpg", "c.jpg")) == {
        "a.jpg": tmp_path / "a.png",
        "b.jpg": tmp_path / "b.npy",
    }


def test_two_maps_of_one_photo_and_one_map_of_two_are_refused(tmp_path):
    depth(tmp_path, "a.png")
    with pytest.raises(InputError, match="could be of several photos called a"):
        depth_files(tmp_path, photos("a.jpg", "a.png"))
    depth(tmp_path, "a.npy")
    with pytest.raises(InputError, match="two depth maps called a"):
        depth_files(tmp_path, photos("a.jpg", "b.jpg"))
