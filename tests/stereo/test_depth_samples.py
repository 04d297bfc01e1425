"""Stereo's pixels as points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.captures.uncertainty import STEREO_WEIGHT, stereo_weight
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.depth_samples import with_depth_samples
from room2dgs.stereo.passes import StereoMap

CAMERA = Camera(np.array([[60.0, 0, 40], [0, 60, 30], [0, 0, 1]]), 80, 60, np.eye(4))


def frame() -> Frame:
    return Frame(name="a", color_path=Path("a.jpg"), camera=CAMERA)


def view() -> tuple[Camera, DenseView]:
    """Half the photo's size: a slanted wall on the right half, with 2 or 7 consistent views."""
    camera = CAMERA.resized(40, 30)
    depth = np.zeros((30, 40), np.float32)
    depth[:, 20:] = np.linspace(2, 3, 20, dtype=np.float32)
    num_consistent = np.where(np.arange(30)[:, None] < 15, 2, 7).astype(np.uint8) * (depth > 0)
    zero = np.zeros_like(depth)
    return camera, DenseView(
        depth, np.zeros((30, 40, 3), np.float32), num_consistent, zero, np.zeros((3, 30, 40), np.float32)
    )


def test_a_pixel_becomes_a_point_where_its_photo_sees_it_with_the_weight_of_its_consistent_views():
    camera, dense = view()
    sparse = PointCloud(
        np.array([[0.0, 0, 2]]),
        np.zeros((1, 3), np.uint8),
        Tracks(("b",), np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[1.0, 1]], np.float32)),
    )
    both = with_depth_samples(sparse, [frame()], [camera], {"a": StereoMap(dense.depth, dense.num_consistent)})
    assert len(both) == 1 + np.count_nonzero(dense.depth)
    assert both.weight_of(np.array([0])) == 1
    seen = seen_points(both, frame())
    column, row = (seen.pixel / 2).astype(int).T
    np.testing.assert_allclose(seen.depth, dense.depth[row, column], rtol=1e-6)
    np.testing.assert_allclose(both.weight_of(seen.index), stereo_weight(dense.num_consistent[row, column]))
    projected, _ = CAMERA.project(both.xyz[seen.index])
    np.testing.assert_allclose(projected, seen.pixel, atol=1e-4)


def test_points_without_tracks_stay_among_those_that_photos_see():
    camera, dense = view()
    both = with_depth_samples(
        PointCloud(np.array([[0.0, 0, 2]]), np.zeros((1, 3), np.uint8)),
        [frame()],
        [camera],
        {"a": StereoMap(dense.depth, dense.num_consistent)},
    )
    assert 0 in seen_points(both, frame()).index


def test_weight_grows_with_the_number_of_consistent_views():
    assert stereo_weight(np.array([0])) == 0 and stereo_weight(np.array([200])) == 1
    assert (np.diff(STEREO_WEIGHT) > 0).all()
