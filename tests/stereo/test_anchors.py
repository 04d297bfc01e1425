"""Stereo's pixels as points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.anchors import TRUST, trust, with_stereo
from room2dgs.stereo.dense import DenseView

CAMERA = Camera(np.array([[60.0, 0, 40], [0, 60, 30], [0, 0, 1]]), 80, 60, np.eye(4))


def frame() -> Frame:
    return Frame(name="a", color_path=Path("a.jpg"), camera=CAMERA)


def view() -> tuple[Camera, DenseView]:
    """Half the photo's size: a slanted wall on the right half, on which 2 or 7 views agree."""
    camera = CAMERA.resized(40, 30)
    depth = np.zeros((30, 40), np.float32)
    depth[:, 20:] = np.linspace(2, 3, 20, dtype=np.float32)
    agreeing = np.where(np.arange(30)[:, None] < 15, 2, 7).astype(np.uint8) * (depth > 0)
    zero = np.zeros_like(depth)
    return camera, DenseView(
        depth, np.zeros((30, 40, 3), np.float32), agreeing, zero, np.zeros((3, 30, 40), np.float32)
    )


def test_a_pixel_becomes_a_point_where_its_photo_sees_it_with_the_trust_of_its_agreeing_views():
    camera, dense = view()
    sparse = PointCloud(
        np.array([[0.0, 0, 2]]),
        np.zeros((1, 3), np.uint8),
        Tracks(("b",), np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[1.0, 1]], np.float32)),
    )
    both = with_stereo(sparse, [frame()], [camera], {"a": (dense.depth, dense.agreeing)})
    assert len(both) == 1 + np.count_nonzero(dense.depth)
    assert both.weight_of(np.array([0])) == 1
    seen = seen_points(both, frame())
    column, row = (seen.pixel / 2).astype(int).T
    np.testing.assert_allclose(seen.depth, dense.depth[row, column], rtol=1e-6)
    np.testing.assert_allclose(both.weight_of(seen.index), trust(dense.agreeing[row, column]))
    projected, _ = CAMERA.project(both.xyz[seen.index])
    np.testing.assert_allclose(projected, seen.pixel, atol=1e-4)


def test_points_without_tracks_stay_among_those_that_photos_see():
    camera, dense = view()
    both = with_stereo(
        PointCloud(np.array([[0.0, 0, 2]]), np.zeros((1, 3), np.uint8)),
        [frame()],
        [camera],
        {"a": (dense.depth, dense.agreeing)},
    )
    assert 0 in seen_points(both, frame()).index


def test_trust_grows_with_the_views_that_agree():
    assert trust(np.array([0])) == 0 and trust(np.array([200])) == 1
    assert (np.diff(TRUST) > 0).all()
