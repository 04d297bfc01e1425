"""A pipe or a link to itself where a layout's file belongs: one sentence at once, and nothing waits."""

from __future__ import annotations

import os

import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError

FILES = {
    "scannet": ("intrinsic/intrinsic_color.txt",),
    "scannet_flat": ("_info.txt",),
    "sens": ("scene0000_00.sens",),
    "replica": ("traj.txt",),
    "tum": ("rgb.txt", "groundtruth.txt"),
    "neuralrgbd": ("poses.txt",),
    "monosdf": ("cameras.npz",),
    "sdfstudio": ("meta_data.json",),
    "polycam_zip": ("capture.zip",),
    "record3d": ("metadata.json",),
    "record3d_archive": ("room.r3d",),
    "stray": ("odometry.csv", "camera_matrix.csv", "rgb.mp4"),
    "arkitscenes": ("41069021_frames/lowres_wide.traj",),
    "open3d": ("scene/trajectory.log",),
    "ros1": ("walk.bag",),
    "ros2": ("walk.db3",),
    "ros_mcap": ("ros_mcap.mcap",),
}


@pytest.mark.parametrize(("name", "file"), [(name, file) for name, files in FILES.items() for file in files])
@pytest.mark.parametrize("spoil", [os.mkfifo, lambda path: path.symlink_to(path), lambda path: path.mkdir()])
def test_no_regular_file_is_a_sentence(written, settings_of, name, file, spoil):
    root = written(name)
    (root / file).unlink()
    spoil(root / file)
    with pytest.raises(InputError) as caught:
        read_scene(settings_of(root, name))
    assert "\n" not in str(caught.value) and str(root) in str(caught.value)
