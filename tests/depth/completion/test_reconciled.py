"""Views that were corrected one by one: what neighbours and planes make of them."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.depth.completion.planes import Plane
from room2dgs.depth.completion.reconciled import on_their_planes, with_neighbours
from room2dgs.geometry.camera import Camera

SHAPE = (30, 40)
INSIDE = (slice(5, 18), slice(5, 25))  # what all views see


@pytest.fixture
def wall():
    """Six views, side by side, of a wall at z = 2 m."""
    K = np.array([[32.0, 0, 20], [0, 32.0, 15], [0, 0, 1]])
    parts = []
    for k in range(6):
        cam_from_world = np.eye(4)
        cam_from_world[:3, 3] = [-0.05 * k, -0.02 * k, 0]
        depth, none = np.full(SHAPE, 2, np.float32), np.zeros(SHAPE, np.float32)
        parts.append(Completed(Camera(K, 40, 30, cam_from_world), none, none, none, depth, none))
    return parts


def at(part, depth):
    return part._replace(depth=np.full(SHAPE, depth, np.float32))


def errors(first, others):
    return [np.full(SHAPE, first, np.float32), *(np.full(SHAPE, others, np.float32) for _ in range(5))]


NEAR = [[k for k in range(6) if k != view] for view in range(6)]


def test_an_unsure_view_goes_where_sure_ones_are_and_its_scale_with_it(wall):
    parts, left = with_neighbours([at(wall[0], 2.1), *wall[1:]], errors(0.05, 0.004), NEAR)
    moved = parts[0]
    assert np.abs(moved.depth[INSIDE] - 2).max() < 0.02
    np.testing.assert_allclose(moved.log_scale, np.log(moved.depth / 2.1), atol=1e-6)
    # what is left of the difference adds next to nothing
    np.testing.assert_allclose(left[0][INSIDE], 0.05, rtol=0.05)
    assert all(np.abs(part.depth[INSIDE] - 2).max() < 0.01 for part in parts[1:])


def test_a_sure_view_of_something_else_stays(wall):
    parts, _ = with_neighbours([at(wall[0], 1.5), *wall[1:]], errors(0.004, 0.004), NEAR)
    assert np.abs(parts[0].depth - 1.5).max() < 0.01


def test_two_that_are_sure_of_different_depths_are_less_sure_then(wall):
    parts, left = with_neighbours([at(wall[0], 1.9), *wall[1:]], errors(0.01, 0.01), NEAR)
    away = np.log(2 / parts[0].depth[INSIDE])
    assert (away > 0.02).all()
    np.testing.assert_allclose(left[0][INSIDE], np.hypot(0.01, away), rtol=1e-3)
    # those that are far less sure make it no less so
    _, sure = with_neighbours([at(wall[0], 1.9), *wall[1:]], errors(0.004, 0.03), NEAR)
    assert (sure[0] == np.float32(0.004)).all()
    # whom nobody asks keeps its word
    alone, same = with_neighbours([at(wall[0], 1.9), *wall[1:]], errors(0.01, 0.01), [[] for _ in range(6)])
    assert (alone[0].depth == np.float32(1.9)).all() and (same[0] == np.float32(0.01)).all()


def test_what_is_unknown_stays_so(wall):
    parts, left = with_neighbours([at(wall[0], 0), *wall[1:]], errors(0.05, 0.004), NEAR)
    assert not parts[0].depth.any() and np.isfinite(parts[0].log_scale).all() and np.isfinite(left[0]).all()


@pytest.mark.parametrize(
    ("depth", "error", "expected"),
    [
        (2.01, 0.02, 2.0),  # noise on a wall
        (1.97, 0.001, 1.97),  # a picture that hangs on it
        (1.5, 0.5, 1.5),  # something else altogether
    ],
)
def test_depth_goes_to_a_plane_that_it_expects_to_be_on(wall, depth, error, expected):
    normal = np.tile(np.float32([0, 0, -1]), (*SHAPE, 1))
    none = np.zeros(SHAPE, np.float32)
    maps = LowResInput(wall[0].camera, normal, normal, none, none, none, none, (none, none), none, (none, none))
    plane = Plane(np.array([0.0, 0, -1]), -2.0, 1.0)
    (part,) = on_their_planes([maps], [at(wall[0], depth)], [np.full(SHAPE, error, np.float32)], [plane])
    assert np.abs(part.depth - expected).max() < 2e-3
    np.testing.assert_allclose(part.log_scale, np.log(part.depth / depth), atol=1e-6)
