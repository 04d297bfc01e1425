"""A path through cameras: it passes through them, its speed is even and its turning smooth."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.camera_path import smooth_path
from room2dgs.geometry.poses import pose_at

K = np.array([[50.0, 0, 32], [0, 50.0, 24], [0, 0, 1]])


def around(angle: float, radius: float = 2.0, tilt: float = 0.2) -> Camera:
    """On a circle, looking along its tangent, tilted."""
    rotation = Rotation.from_euler("yx", [angle, tilt]).as_matrix().T
    return Camera(K, 64, 48, pose_at(rotation, radius * np.array([np.sin(angle), 0.1 * angle, np.cos(angle)])))


def test_it_begins_ends_and_passes_where_it_should():
    given = [around(angle) for angle in np.linspace(0, 3.0, 7)]  # evenly spaced: so are their times
    found = smooth_path(given, 13)
    for one, other in zip(found[::2], given, strict=True):
        assert np.allclose(one.cam_from_world, other.cam_from_world, atol=1e-4)
    assert all(camera.size == (64, 48) and np.array_equal(camera.K, K) for camera in found)


def test_between_cameras_it_follows_the_circle():
    found = smooth_path([around(angle) for angle in np.linspace(0, 3.0, 9)], 101)
    inner = found[15:-15]  # a natural spline is straight at its ends
    radius = np.array([np.hypot(camera.centre[0], camera.centre[2]) for camera in inner])
    assert np.abs(radius - 2.0).max() < 5e-3  # straight pieces: 0.035
    steps = np.linalg.norm(np.diff([camera.centre for camera in inner], axis=0), axis=1)
    assert steps.max() / steps.min() < 1.02
    turns = [Rotation.from_matrix(b.rotation @ a.rotation.T).magnitude() for a, b in pairwise(inner)]
    assert max(turns) / min(turns) < 1.02
    assert all(np.allclose(camera.rotation @ camera.rotation.T, np.eye(3), atol=1e-12) for camera in found)


def test_jitter_stays_out_of_a_path_through_few():
    rng = np.random.default_rng(0)
    given = [Camera(K, 64, 48, pose_at(np.eye(3), [0.1 * i, *(0.03 * rng.normal(size=2))])) for i in range(61)]

    def bends(cameras):
        return np.abs(np.diff([camera.centre for camera in cameras], 2, axis=0)).max()

    assert bends(smooth_path(given, 300, through=4)) < bends(smooth_path(given, 300)) / 10


@pytest.mark.parametrize("count", [1, 5])
def test_cameras_in_one_place_are_a_path_of_one(count):
    assert [c.cam_from_world[0, 3] for c in smooth_path([around(0.0)] * 3, count)] == [
        around(0.0).cam_from_world[0, 3]
    ] * count
