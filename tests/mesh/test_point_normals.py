"""Normals of points on a partition that is seen from one side, or from both."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.mesh.point_normals import oriented_normals, towards_views


@pytest.fixture
def partition() -> np.ndarray:
    """(400, 3) points of the plane x = 0."""
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (400, 3))
    points[:, 0] = 0
    return points


@pytest.fixture
def frames(make):
    """Two views of the partition, from x = -2 and from x = 2."""
    cameras = [make.camera_at((-2, 0, 0), (1, 0, 0)), make.camera_at((2, 0, 0), (-1, 0, 0))]
    return [SimpleNamespace(name=name, camera=camera) for name, camera in zip("ab", cameras, strict=True)]


def seen_by(points: np.ndarray, frames, views: np.ndarray) -> PointCloud:
    """Each point with a track of one observation, in the view of its number."""
    index = np.arange(len(points), dtype=np.int32)
    pixel = np.stack([frames[view].camera.project(point)[0] for view, point in zip(views, points, strict=True)])
    tracks = Tracks(("a", "b"), views.astype(np.int32), index, pixel.astype(np.float32))
    return PointCloud(points, np.zeros((len(points), 3), np.uint8), tracks)


def test_each_point_faces_the_view_that_its_track_names(partition, frames):
    """Both views have all of them in the picture."""
    views = (partition[:, 1] > 0).astype(int)
    towards = towards_views(seen_by(partition, frames, views), frames, 8.0)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 1)
    normals = oriented_normals(partition, towards)
    np.testing.assert_allclose(normals, np.where(views[:, None], [[1.0, 0, 0]], [[-1.0, 0, 0]]), atol=1e-9)


def test_without_tracks_the_views_guess_and_what_none_sees_has_no_side(partition, frames):
    behind = np.array([[-9.0, 0, 0]])
    points = np.concatenate([partition, behind])
    towards = towards_views(PointCloud(points, np.zeros((len(points), 3), np.uint8)), frames[:1], 8.0)
    assert (towards[:-1, 0] < 0).all() and not towards[-1].any()


def test_views_that_are_too_far_away_do_not_count(partition, frames):
    cloud = seen_by(partition, frames, np.zeros(len(partition), int))
    assert towards_views(cloud, frames, 2.01).any() and not towards_views(cloud, frames, 1.99).any()
