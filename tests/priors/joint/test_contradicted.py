"""Sparse points against a depth map."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.captures.seen_points import probably_seen
from room2dgs.geometry.camera import Camera
from room2dgs.priors.joint.contradicted import contradicted

WIDTH, HEIGHT, FOCAL = 160, 120, 150.0


@pytest.fixture
def camera():
    K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
    return Camera(K, WIDTH, HEIGHT, np.eye(4))


def points_at(columns, rows, depth):
    u, v = (axis.ravel() + 0.5 for axis in np.meshgrid(columns, rows))
    return np.stack([(u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL, np.ones_like(u)], axis=1) * depth


def test_only_what_is_near_points_that_are_off_is_contradicted(camera):
    depth = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    right = points_at(np.arange(100, 156, 4), np.arange(4, 116, 4), 2.0)
    wrong = points_at(np.arange(4, 40, 4), np.arange(4, 60, 4), 2.3)
    doubtful = contradicted(depth, probably_seen(np.concatenate([right, wrong]), camera))
    assert doubtful.shape == depth.shape
    assert doubtful[4:60, 4:40].all()
    assert not doubtful[:, 100:].any()
    assert not doubtful[90:, :60].any()  # a wall without points stays


def test_a_third_of_the_points_off_is_borne_and_more_is_not(camera):
    depth = np.full((HEIGHT, WIDTH), 2.0, np.float32)

    def middle(every):
        xyz = points_at(np.arange(20, 140, 2), np.arange(20, 100, 2), 2.0)
        xyz[::every] *= 1.2
        return contradicted(depth, probably_seen(xyz, camera))[40:80, 50:110].mean()

    assert middle(4) == 0.0
    assert middle(2) == 1.0


def test_points_within_five_percent_and_invalid_depth_say_nothing(camera):
    depth = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    depth[:, :80] = 0
    xyz = np.concatenate([points_at(np.arange(0, 78, 2), np.arange(0, 120, 2), 5.0), points_at([120], [60], 2.09)])
    assert not contradicted(depth, probably_seen(xyz, camera)).any()
    assert not contradicted(depth, probably_seen(np.zeros((0, 3)), camera)).any()
