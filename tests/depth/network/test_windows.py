"""Which photos a multi-view network sees together, and the poses that it is given."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.config.card import CardViews
from room2dgs.depth.network.windows import LEAST_UNIT_M, window_poses, windows
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose


def camera(centre, turn=(0.0, 0.0, 0.0)) -> Camera:
    cam_from_world = np.eye(4)
    cam_from_world[:3, :3] = cv2.Rodrigues(np.array(turn, dtype=np.float64))[0]
    cam_from_world[:3, 3] = -cam_from_world[:3, :3] @ np.array(centre, dtype=np.float64)
    return Camera(np.array([[60.0, 0, 40], [0, 60, 30], [0, 0, 1]]), 80, 60, cam_from_world)


numbers = st.floats(-3, 3, allow_nan=False)
cameras = st.lists(st.tuples(*[numbers] * 6), min_size=2, max_size=5).map(
    lambda rows: [camera(row[:3], row[3:]) for row in rows]
)


@given(cameras, st.sampled_from(["world", "first"]), st.sampled_from(["metres", "median_distance"]))
def test_both_directions_of_a_pose_are_the_same_pose(some, origin, unit):
    one = window_poses(some, CardViews(pose="cam_from_world", origin=origin, unit=unit))
    other = window_poses(some, CardViews(pose="world_from_cam", origin=origin, unit=unit))
    np.testing.assert_allclose(one @ other, np.broadcast_to(np.eye(4), one.shape), atol=1e-9)


@given(cameras)
def test_poses_relative_to_the_first_photo_keep_the_way_from_one_camera_to_another(some):
    world = window_poses(some, CardViews(origin="world"))
    first = window_poses(some, CardViews(origin="first"))
    np.testing.assert_allclose(first[0], np.eye(4), atol=1e-9)
    for one, other in zip(world, first, strict=True):
        np.testing.assert_allclose(one @ inverse_pose(world[0]), other, atol=1e-9)


@pytest.mark.parametrize(("places", "unit"), [((0, 2, 5, 9), 2.0), ((0, 4), LEAST_UNIT_M), ((0, 3, 7), 3.0)])
def test_translations_are_in_the_median_distance_from_the_first_camera(places, unit):
    """Depth Anything 3 takes the lower of two middle distances, the first camera's own 0 among them."""
    some = [camera((place, 0, 0), (0, 0.1 * place, 0)) for place in places]
    metres = window_poses(some, CardViews(unit="metres"))
    units = window_poses(some, CardViews(unit="median_distance"))
    np.testing.assert_allclose(units[:, :3, 3] * unit, metres[:, :3, 3], atol=1e-12)
    np.testing.assert_allclose(units[:, :3, :3], metres[:, :3, :3])


def walk(count: int) -> list[Camera]:
    """Along a wall, which all of them face."""
    return [camera((0.3 * step, 0, 0)) for step in range(count)]


@pytest.mark.parametrize("answers", ["all", "first"])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_each_photo_has_one_map_from_a_window_of_different_photos(answers, count):
    found = windows(walk(11), count, answers)
    assert sorted(index for window in found for index in window.answers) == list(range(11))
    for window in found:
        assert len(set(window.views)) == len(window.views) == count
        assert window.answers[0] == window.views[0] and set(window.answers) <= set(window.views)
    assert len(found) == 11 if answers == "first" else len(found) <= 1 + 11 / 2


def test_a_window_looks_at_one_place():
    """Two walks that look away from each other are never mixed where each has photos enough."""
    back = [camera((0.3 * step, 0, 0), (0, np.pi, 0)) for step in range(4)]
    for window in windows([*walk(4), *back], 3, "all"):
        assert len({index // 4 for index in window.views}) == 1


def test_photos_of_one_place_come_after_those_with_a_baseline():
    turned = [camera((0, 0, 0), (0, 0.01 * step, 0)) for step in range(1, 5)]
    found = windows([camera((0, 0, 0)), *turned, camera((0.4, 0, 0))], 3, "first")
    assert all(5 in window.views for window in found)


def test_a_photo_that_shares_nothing_is_filled_up_with_the_nearest():
    alone = camera((0, 0, -1), (0, np.pi, 0))
    found = windows([alone, camera((0, 0, 0)), camera((0.3, 0, 0)), camera((9, 0, 0))], 2, "first")
    assert next(window for window in found if window.views[0] == 0).views == (0, 1)
