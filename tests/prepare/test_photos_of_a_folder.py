"""A folder of photos of several formats: what is read goes into the reconstruction, what is not is counted and told."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from room2dgs.captures import listing
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.prepare.photos import choose_photos
from room2dgs.prepare.stage_cache import StageCache
from tests.captures.heic_file import HEIC


@pytest.fixture
def folder(tmp_path) -> Path:
    path = tmp_path / "photos"
    path.mkdir()
    for seed in range(6):
        noise = np.random.default_rng(seed).integers(0, 255, (30, 40, 3), np.uint8)
        cv2.imwrite(str(path / f"IMG_{seed}.jpg"), cv2.resize(noise, (160, 120), interpolation=cv2.INTER_NEAREST))
    return path


def taken(folder: Path, tmp_path: Path) -> tuple[list[str], list[str]]:
    """Names of the photos that were taken, and the log's lines."""
    lines: list[str] = []
    config = replace(load_config(["scene.path=unused", "out=unused"]).prepare, images=str(folder))
    found, _ = choose_photos(config, tmp_path / "out", StageCache(tmp_path / "work"), lines.append)
    return [photo.name for photo in found], lines


@pytest.mark.parametrize("installed", [False, True])
def test_photos_in_heic_that_cannot_be_read_are_counted(folder, tmp_path, monkeypatch, installed):
    if not installed:
        monkeypatch.setattr(listing, "heic_is_read", lambda: False)
        monkeypatch.setattr(listing, "PHOTO_SUFFIXES", (".jpg", ".png"))
    for seed in range(10, 17):
        (folder / f"IMG_{seed}.HEIC").write_bytes(b"\0\0\0\x24ftypheic\0\0\0\0mif1heic" + bytes(500))
    names, lines = taken(folder, tmp_path)
    assert names == [f"IMG_{seed}.jpg" for seed in range(6)]
    (told,) = [line for line in lines if "HEIC" in line]
    assert told.startswith(f"NOTE: 7 files in {folder} are HEIC, which is not read; ") and "convert them" in told
    assert ("install room2dgs[heic]" in told) == (not installed)


def test_a_folder_of_heic_and_raw_alone_is_refused_by_count(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(listing, "heic_is_read", lambda: False)
    monkeypatch.setattr(listing, "PHOTO_SUFFIXES", (".jpg", ".png"))
    for path in folder.iterdir():
        path.rename(path.with_suffix(".heic" if path.stem > "IMG_2" else ".DNG"))
    with pytest.raises(InputError, match=r"3 files in .* are \.dng, 3 HEIC, which is not read; convert them"):
        taken(folder, tmp_path)


def test_heic_is_taken_and_written_as_png(folder, tmp_path):
    (folder / "IMG_7.heic").write_bytes(HEIC)
    names, _ = taken(folder, tmp_path)
    assert names[-1] == "IMG_7.png"
    y, x = np.mgrid[:48, :64]
    pixels = np.asarray(Image.open(tmp_path / "out/IMG_7.png"))
    assert np.abs(pixels - np.stack([4 * x, 5 * y, 0 * x + 90], axis=-1)).mean() < 3


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda path: path.symlink_to("nothing"), "is a link to nothing, which is not there"),
        (os.mkfifo, "is a pipe where a file belongs"),
        (Path.mkdir, "is a folder where a file belongs"),
        (Path.touch, "it is empty"),
        (lambda path: path.write_bytes(b"%!PS-Adobe-3.0\n"), "it is not an image"),
    ],
)
def test_a_photo_that_is_none_is_left_out_by_name_and_several_are_one_sentence(folder, tmp_path, spoil, told):
    (folder / "IMG_3.jpg").unlink()
    spoil(folder / "IMG_3.jpg")
    names, lines = taken(folder, tmp_path)
    (said,) = [line for line in lines if line.startswith("WARNING")]
    assert "(1 of 6): IMG_3.jpg" in said and told in said
    assert names == [f"IMG_{seed}.jpg" for seed in range(6) if seed != 3]
    (folder / "IMG_4.jpg").unlink()
    spoil(folder / "IMG_4.jpg")
    with pytest.raises(InputError, match=rf"{told}.*the first of 2 photos"):
        taken(folder, tmp_path / "more")


@pytest.mark.parametrize("name", ["{}_mask.png", "mask_{}.png", "{}.jpg.mask.png", "{}_depth.png", "{}-depth.png"])
def test_masks_and_depth_maps_among_photos_are_no_photos(folder, tmp_path, name):
    for seed in range(6):
        cv2.imwrite(str(folder / name.format(f"IMG_{seed}")), np.zeros((120, 160), np.uint8))
    names, lines = taken(folder, tmp_path)
    assert names == [f"IMG_{seed}.jpg" for seed in range(6)]
    assert any(line.startswith(f"NOTE: 6 files in {folder} are called as masks or depth maps") for line in lines)


def test_a_photo_that_is_only_called_as_a_mask_is_one(folder, tmp_path):
    (folder / "IMG_5.jpg").rename(folder / "room mask.jpg")
    assert "room mask.jpg" in taken(folder, tmp_path)[0]


def test_folders_of_masks_are_told(folder, tmp_path):
    (folder / "masks").mkdir()
    assert any(f"{folder / 'masks'} is not used for the poses" in line for line in taken(folder, tmp_path)[1])
