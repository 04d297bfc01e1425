"""Any files of a capture, or any lines of a list of its poses, are gone: what is left is right, or refused; not wrong.

Photos that were deleted beside a whole trajectory once moved all poses behind them by one place.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.registry import LAYOUTS
from tests.captures.known_scene import known, wrong

# lists of which a line or several say one photo's pose, name or time, with the lines of a photo
LISTS = {
    "scannet": (),
    "colmap": ("sparse/0/images.txt", "sparse/0/points3D.txt"),
    "replica": ("traj.txt",),
    "tum": ("rgb.txt", "depth.txt"),
    "neuralrgbd": ("poses.txt",),
    "stray": ("odometry.csv",),
    "open3d": ("scene/trajectory.log",),
    "arkitscenes": ("41069021_frames/lowres_wide.traj",),
}
ONE_FILE = {"sens", "polycam_zip", "record3d_archive", "ros1", "ros2", "ros_mcap"}


def files_of(root: Path) -> list[str]:
    return sorted(str(path.relative_to(root)) for path in root.rglob("*") if path.is_file())


@pytest.mark.parametrize("name", sorted(set(LAYOUTS) - ONE_FILE))
def test_any_files_may_be_gone(written, settings_of, made, tmp_path, name):
    root = written(name)
    config = settings_of(root, name)
    truth = known(read_scene(config), made)
    files = files_of(root)
    away = tmp_path / "away"
    away.mkdir()

    @settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(st.sets(st.sampled_from(files), min_size=1, max_size=len(files) - 1))
    def delete(gone: set[str]) -> None:
        for number, file in enumerate(sorted(gone)):
            os.replace(root / file, away / str(number))
        try:
            assert not wrong(read_scene(config), made, truth)
        except InputError as error:
            assert "\n" not in str(error)
        finally:
            for number, file in enumerate(sorted(gone)):
                os.replace(away / str(number), root / file)

    delete()


@pytest.mark.parametrize(("name", "file"), [(name, file) for name, files in LISTS.items() for file in files])
def test_any_lines_of_a_list_may_be_gone(written, settings_of, made, name, file):
    root = written(name)
    config = settings_of(root, name)
    truth = known(read_scene(config), made)
    path = root / file
    lines = path.read_text().splitlines(keepends=True)

    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(st.sets(st.integers(0, len(lines) - 1), min_size=1, max_size=min(12, len(lines) - 1)))
    def delete(gone: set[int]) -> None:
        path.write_text("".join(line for number, line in enumerate(lines) if number not in gone))
        try:
            assert not wrong(read_scene(config), made, truth)
        except InputError as error:
            assert "\n" not in str(error)

    delete()


@pytest.mark.parametrize("name", sorted(set(LAYOUTS) - ONE_FILE - {"scannetpp_iphone", "stray"}))
def test_every_second_photo_may_be_gone(written, settings_of, made, name):
    """What people do to a capture that is too large: it is read, and right, wherever names or numbers tell."""
    root = written(name)
    config = replace(settings_of(root, name), split="every")  # the capture's own test photo would leave two
    truth = known(read_scene(config), made)
    photos = [path for path in photo_files(root) if path.suffix.lower() in (".jpg", ".png")]
    assert len(photos) == made.count
    for path in photos[1::2]:
        path.unlink()
    scene = read_scene(config)
    assert len(scene.frames) == made.count // 2
    assert not wrong(scene, made, truth)
    shutil.rmtree(root)


def photo_files(root: Path) -> list[Path]:
    """The photos of a capture: files that hold three channels and are no masks."""
    from PIL import Image

    found = []
    for file in files_of(root):
        if Path(file).suffix.lower() not in (".jpg", ".png") or "mask" in file:
            continue
        with Image.open(root / file) as image:
            if image.mode == "RGB":
                found.append(root / file)
    return found
