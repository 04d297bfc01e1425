"""Readers that other installed packages bring."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from room2dgs.captures.listing import Listing
from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.choice import reader_of
from room2dgs.errors import InputError
from room2dgs.registries.readers import READERS

# A layout with a name of its own for the file of poses.
TEXT = """
from room2dgs.captures.capture import Capture, Shot, pinhole_lens
from room2dgs.captures.listing import photos_in
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import floats, lines_of
import numpy as np

def recognise(files):
    return "ours.poses" in files

def read(root, config):
    poses = [np.array(floats(text, root, line, 16)).reshape(4, 4) for line, text in lines_of(root / "ours.poses")]
    lens = pinhole_lens(81.0, 84.0, 46.5, 37.25, (96, 72), root, half=True)
    names = photos_in(root / "photos")
    shots = [Shot(name, root / "photos" / name, pose, lens) for name, pose in zip(names, poses, strict=True)]
    return Capture(root, "ours", shots)

READER = Reader(recognise, read, "photos/ and ours.poses")
"""
POINTS = "[room2dgs.readers]\nours = {package}:READER\n"


@pytest.fixture
def capture(tmp_path, written, made):
    """The made scene in a layout that only the package knows."""
    root = tmp_path / "capture"
    root.mkdir()
    (written("replica") / "results").rename(root / "photos")
    for depth in (root / "photos").glob("depth*"):
        depth.unlink()
    np.savetxt(root / "ours.poses", made.poses.reshape(-1, 16))
    return root


def test_an_installed_packages_reader_recognises_and_reads_its_layout(capture, settings, made, installed):
    with pytest.raises(InputError, match=r"poses are unknown|is in no layout"):
        read_scene(settings(capture))
    installed("our_reader", TEXT, POINTS.format(package="our_reader"))
    assert READERS.get("ours").package == "our_reader"
    scene = read_scene(settings(capture))
    assert scene.layout == "ours"
    for frame, pose in zip(scene.frames, made.poses, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-9)


def test_a_broken_reader_is_told_and_does_not_stop_captures_of_other_layouts(
    written, settings, installed, logged_warnings
):
    installed("broken_reader", "import nothing_like_it", POINTS.format(package="broken_reader"))
    root = written("replica")
    assert reader_of(settings(root), Listing(root)).name == "replica"
    said = "layout ours of the package broken_reader cannot be imported"
    assert any(said in line for line in logged_warnings.messages)
    with pytest.raises(InputError, match=said):
        READERS.load("ours")


def test_a_setting_names_the_reader_of_a_package(capture, made, installed, tmp_path):
    """Settings are checked in a process that has the package from its start."""
    installed("named_reader", TEXT, POINTS.format(package="named_reader"))
    code = (
        "from room2dgs.captures.read import read_scene\n"
        "from room2dgs.config import load_config\n"
        f"settings = load_config(['scene.path={capture}', 'out=unused', 'scene.layout=ours'])\n"
        "print(len(read_scene(settings.scene).frames))"
    )
    path = str(tmp_path / "installed" / "named_reader")
    found = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path}
    )
    assert int(found.stdout) == len(made.poses)


def test_each_of_our_own_readers_is_where_the_list_says():
    for entry in READERS.entries():
        reader = entry.load()
        assert reader.needs and set(reader.contains) <= set(READERS), entry.name
