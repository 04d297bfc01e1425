"""Depth maps and masks that a capture's list names: missing ones are told; the unit of fractions is what they hold."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError


def edited(path: Path, change) -> None:
    meta = json.loads(path.read_text())
    change(meta)
    path.write_text(json.dumps(meta))


def depth_as(root: Path, made, suffix: str, factor: float, kind: str = "<f4") -> None:
    """The maps of a transforms.json in other files, in `factor` units a metre."""

    def change(meta):
        for frame in meta["frames"]:
            path = root / frame["depth_file_path"]
            values = np.round(made.depths[int(path.stem[-5:]) - 8] / 1000 * factor, 3).astype(kind)
            path.unlink()
            path = path.with_suffix(suffix)
            np.save(path, values) if suffix == ".npy" else cv2.imwrite(str(path), values)
            frame["depth_file_path"] = f"depth/{path.name}"

    edited(root / "transforms.json", change)


def errors(scene, made) -> list[float]:
    return [np.abs(f.depth() - d / 1000).max() for f, d in zip(scene.frames, made.depths, strict=True)]


@pytest.mark.parametrize("suffix", [".npy", ".tiff"])
def test_fractions_as_small_as_metres_are_metres(written, settings, made, suffix):
    root = written("nerfstudio")
    depth_as(root, made, suffix, 1.0)
    scene = read_scene(settings(root))
    assert max(errors(scene, made)) < 1e-6
    assert "read as metres" in " ".join(scene.notes)


@pytest.mark.parametrize(("factor", "kind"), [(1000.0, "<f4"), (1000.0, "<u2")])
def test_millimetres_stay_millimetres(written, settings, made, factor, kind):
    root = written("nerfstudio")
    depth_as(root, made, ".npy", factor, kind)
    scene = read_scene(settings(root))
    assert max(errors(scene, made)) < 1e-6
    assert "read as metres" not in " ".join(scene.notes)


def test_a_unit_that_the_file_gives_counts_whatever_the_numbers(written, settings, made):
    root = written("nerfstudio")
    depth_as(root, made, ".npy", 1.0)
    edited(root / "transforms.json", lambda meta: meta.update(depth_unit_scale_factor=0.5))
    depth = read_scene(settings(root)).frames[0].depth()
    assert np.abs(depth - made.depths[0] / 2000).max() < 1e-6


def test_sdfstudio_depth_that_is_not_there_is_no_depth(written, settings):
    root = written("sdfstudio")
    edited(root / "meta_data.json", lambda m: [f.update(sensor_depth_path="gone.npy") for f in m["frames"]])
    scene = read_scene(settings(root))
    assert [frame.depth_path for frame in scene.frames] == [None] * 6
    assert "names 6 depth maps, 6 of which are not there" in " ".join(scene.warnings)
    assert not any(note.startswith("sensor depth") for note in scene.notes)


def test_sdfstudio_masks_that_are_not_there_stop_the_reading(written, settings):
    root = written("sdfstudio")
    edited(root / "meta_data.json", lambda m: [f.update(foreground_mask="gone.png") for f in m["frames"]])
    with pytest.raises(InputError, match=r"gone.png is missing \(the first of 6 masks that are named and not there"):
        read_scene(settings(root))
