"""7-Scenes' depth camera is known at 640x480; maps of another size are of the same camera."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.sevenscenes import DEPTH_K
from room2dgs.errors import InputError


def with_depth(root, made, size):
    for index in range(made.count):
        depth = np.full(size[::-1], 2000, np.uint16)
        depth[:, : size[0] // 2] = 1000  # the left half is nearer
        cv2.imwrite(str(root / f"seq-0{1 + index // 3}/frame-{index:06d}.depth.png"), depth)


@pytest.mark.parametrize("size", [(640, 480), (320, 240), (96, 72)])
def test_depth_of_any_size_is_seen_where_its_camera_sees_it(written, settings_of, made, size):
    root = written("sevenscenes")
    with_depth(root, made, size)
    frame = read_scene(settings_of(root, "sevenscenes")).frames[0]
    depth, camera = frame.depth(), frame.camera
    rays = camera.rays()
    column = rays[..., 0] * DEPTH_K[0][0] + DEPTH_K[0][2]  # of 640
    sure = (np.abs(column - 320) > 20) & (column > 5) & (column < 635)
    middle = np.abs(rays[..., 1] * DEPTH_K[1][1]) < 200
    expected = np.where(column < 320, 1.0, 2.0)
    assert (sure & middle).mean() > 0.5
    assert np.array_equal(depth[sure & middle], expected[sure & middle])


def test_depth_of_another_shape_is_refused(written, settings_of, made):
    root = written("sevenscenes")
    with_depth(root, made, (72, 96))
    with pytest.raises(InputError, match="lies on its side"):
        read_scene(settings_of(root, "sevenscenes"))
