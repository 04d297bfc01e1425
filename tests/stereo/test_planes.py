"""Planes in inverse depth: their normals, other sizes, and planes of a depth map."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.geometry.camera import Camera
from room2dgs.stereo.planes import plane_normals, planes_of_depth, resized_planes

CAMERA = Camera(np.array([[50.0, 0, 33.5], [0, 44.0, 19.0], [0, 0, 1]]), 60, 40, np.eye(4))
slopes = st.floats(-0.6, 0.6)


def plane_through(camera, normal, d):
    """(3, H, W) of n . P = d in the camera's frame."""
    a = np.asarray(normal, float) / d
    x = (np.arange(camera.width) + 0.5 - camera.K[0, 2]) / camera.K[0, 0]
    y = (np.arange(camera.height)[:, None] + 0.5 - camera.K[1, 2]) / camera.K[1, 1]
    w = a[0] * x + a[1] * y + a[2] + np.zeros((camera.height, camera.width))
    flat = np.ones_like(w)
    return np.stack([w, flat * a[0] / camera.K[0, 0], flat * a[1] / camera.K[1, 1]]).astype(np.float32)


@given(slopes, slopes, st.floats(0.5, 6))
def test_normals_are_the_planes_own_and_face_the_camera(p, q, d):
    normal = np.array([p, q, 1.0]) / np.linalg.norm([p, q, 1.0])
    planes = plane_through(CAMERA, normal, d)
    found = plane_normals(planes, CAMERA)
    seen = planes[0] > 0
    np.testing.assert_allclose(found[seen], np.broadcast_to(-normal, found[seen].shape), atol=2e-5)
    assert (found[~seen] == 0).all()


@given(slopes, slopes, st.integers(20, 150), st.integers(15, 90))
def test_a_plane_stays_that_plane_at_another_size(p, q, width, height):
    normal = np.array([p, q, 1.0])
    planes = plane_through(CAMERA, normal, 2.0)
    camera = CAMERA.resized(width, height)
    found = resized_planes(planes, width, height)
    expected = plane_through(camera, normal, 2.0)
    sure = expected[0] > 0.15  # not carried beyond the horizon
    np.testing.assert_allclose(found[:, sure], expected[:, sure], rtol=2e-4, atol=1e-6)


def test_planes_of_an_exact_depth_map_are_exact_inside():
    planes = plane_through(CAMERA, [0.2, -0.1, 1.0], 2.0)
    depth = 1 / planes[0]
    depth[10:14, 20:26] = 0
    found = planes_of_depth(depth)
    assert (found[0, 10:14, 20:26] == 0).all()
    np.testing.assert_allclose(found[0][depth > 0], planes[0][depth > 0], rtol=1e-6)
    np.testing.assert_allclose(found[1:, 20:-1, 1:-1], planes[1:, 20:-1, 1:-1], rtol=1e-3, atol=1e-6)
    assert (found[1:, 9, 20:26] == 0).all()  # beside the hole the slope is not known


def test_no_plane_has_no_normal():
    assert (plane_normals(np.zeros((3, 40, 60), np.float32), CAMERA) == 0).all()
