"""TUM's lists as people have them: times in other units, photos and depth in one list."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.captures.trajectories import in_seconds

LISTS = ("rgb.txt", "depth.txt", "groundtruth.txt")


def check(scene, made) -> None:
    assert len(scene.frames) == made.count
    for frame, pose, depth in zip(scene.frames, made.poses, made.depths, strict=True):
        assert np.abs(frame.camera.world_from_cam - pose).max() < 1e-9
        assert np.abs(frame.depth() - depth / 1000).max() < 1e-6


def in_unit(path: Path, factor: float, form: str) -> None:
    lines = (line.partition(" ") for line in path.read_text().splitlines())
    path.write_text(
        "\n".join(
            f"{time} {rest}" if time == "#" else f"{format(float(time) * factor, form)} {rest}"
            for time, _, rest in lines
        )
    )


@pytest.mark.parametrize(
    ("factor", "form", "unit"), [(1e3, ".3f", "milli"), (1e6, ".0f", "micro"), (1e9, ".0f", "nano")]
)
@pytest.mark.parametrize("files", [LISTS, LISTS[2:], LISTS[:2]])
def test_times_may_be_in_smaller_units(written, settings_of, made, files, factor, form, unit):
    root = written("tum")
    for name in files:
        in_unit(root / name, factor, form)
    scene = read_scene(settings_of(root, "tum"))
    check(scene, made)
    assert f"times: those in {files[-1]} are {unit}seconds, by their size" in scene.notes


def test_times_that_count_from_a_start_stay_as_they_are():
    stamps = np.array([0.0, 1500.0, 3e6])
    assert in_seconds(stamps)[0] is stamps


@pytest.mark.parametrize("depth_first", [False, True])
@pytest.mark.parametrize("name", ["associations.txt", "rgb.txt"])
def test_photos_and_depth_in_one_list(written, settings_of, made, name, depth_first):
    root = written("tum")
    lists = [(root / file).read_text().splitlines()[1:] for file in LISTS[:2]]
    (root / "rgb.txt").unlink()
    if name != "rgb.txt":
        (root / "depth.txt").unlink()
    pairs = zip(*(lists[::-1] if depth_first else lists), strict=True)
    (root / name).write_text("\n".join(" ".join(pair) for pair in pairs))
    check(read_scene(settings_of(root, "tum")), made)
