"""Advice to walk is for captures of one place alone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.one_place import WALK, in_one_place
from room2dgs.sfm.sparse import MayLack, _too_few_to_use

K = np.array([[80.0, 0, 48], [0, 80, 36], [0, 0, 1]])


def scene(apart: float, depth: float | None, metric: bool) -> Scene:
    """Cameras along a line before points in a plane."""
    frames = []
    for x in np.linspace(0, apart, 5):
        pose = np.eye(4)
        pose[0, 3] = -x
        frames.append(SimpleNamespace(name=f"{x}", camera=Camera(K, 96, 72, pose)))
    side = np.linspace(-0.2, 0.2, 10) * (depth or 1)
    xyz = np.stack([*(axis.ravel() for axis in np.meshgrid(side, side)), np.full(100, depth or 1.0)], axis=1)
    points = None if depth is None else lambda: PointCloud(xyz, np.zeros((100, 3), np.uint8))
    return Scene("capture", tuple(frames), (), metric=metric, given_points=points)


@pytest.mark.parametrize(
    ("apart", "depth", "metric", "one"),
    [
        (0.02, None, True, True),
        (0.5, None, True, False),
        (0.02, 0.3, False, False),  # a unit of ten metres
        (0.002, 0.3, False, True),
        (20.0, 3000.0, False, True),  # millimetres
        (500.0, 3000.0, False, False),
        (0.02, None, False, True),
    ],
)
def test_one_place_is_known_in_metres_or_beside_the_points_depth(apart, depth, metric, one):
    assert in_one_place(scene(apart, depth, metric)) == one


@pytest.mark.parametrize(("apart", "told"), [(0.01, True), (2.0, False)])
def test_walking_is_advised_only_to_who_did_not(apart, told):
    said = _too_few_to_use(scene(apart, None, True), 3, MayLack.WITH_METRES)
    assert (WALK in said) == told and "the prior's alone" in said


def test_points_that_cannot_be_read_leave_the_distance_in_units():
    def broken():
        from room2dgs.errors import InputError

        raise InputError("points3D.bin is missing")

    assert in_one_place(replace(scene(0.01, None, False), given_points=broken))
