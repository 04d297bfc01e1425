"""The rectangle of a mirror in a camera: where its glass is, and what stands before it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.mirrors.mirror import Mirror, behind_glass, shown
from room2dgs.mirrors.settle import best_plane, reflected
from room2dgs.mirrors.walls import Plane
from tests.mirrors.made import looking

MIRROR = Mirror(np.array([[1.2, 0, 0.9], [2.6, 0, 0.9], [2.6, 0, 2.0], [1.2, 0, 2.0]])[::-1], 5)
CAMERA = looking(np.array([1.9, 2.0, 1.4]), np.array([1.9, 0.0, 1.4]), (160, 120))


def test_its_normal_is_towards_the_room_and_its_size_that_of_its_sides():
    np.testing.assert_allclose(MIRROR.normal, [0, 1, 0], atol=1e-12)
    assert sorted(MIRROR.size_m) == pytest.approx([1.1, 1.4])


def test_its_glass_lies_in_its_plane_and_within_its_corners():
    glass = MIRROR.glass(CAMERA)
    place = CAMERA.centre + CAMERA.world_rays() * glass[..., None]
    seen = glass > 0
    np.testing.assert_allclose(place[seen][:, 1], 0, atol=1e-9)
    assert (place[seen][:, [0, 2]] >= [1.2 - 1e-9, 0.9 - 1e-9]).all()
    assert (place[seen][:, [0, 2]] <= [2.6 + 1e-9, 2.0 + 1e-9]).all()
    wall = (2.0 / 0.75) * (2.0 / 0.75 * 120 / 160)  # square metres of it that the camera sees
    assert seen.mean() == pytest.approx(1.4 * 1.1 / wall, rel=0.05)


def test_from_behind_there_is_no_glass():
    behind = looking(np.array([1.9, -2.0, 1.4]), np.array([1.9, 0.0, 1.4]), (160, 120))
    assert not MIRROR.glass(behind).any()


@pytest.mark.parametrize(("depth", "hidden"), [(4.5, True), (2.0, True), (0.0, True), (1.5, False)])
def test_what_stands_before_it_is_not_shown_by_it(depth, hidden):
    whole = np.full((120, 160), depth)
    glass = shown(whole, CAMERA, [MIRROR])
    assert (glass > 0).any() == hidden
    room = behind_glass(whole.astype(np.float32), glass)
    assert room.dtype == np.float32
    np.testing.assert_allclose(room[glass > 0], min(depth, 2.0), rtol=1e-6)
    np.testing.assert_array_equal(room[glass == 0], np.float32(depth))


def test_of_two_mirrors_the_nearer_is_the_one_that_is_seen():
    nearer = Mirror(MIRROR.corners + np.array([0, 0.5, 0]), 3)
    glass = shown(np.full((120, 160), 4.0), CAMERA, [MIRROR, nearer])
    assert glass[60, 80] == pytest.approx(1.5)


@given(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(-3, 3), st.integers(0, 1000))
def test_reflecting_twice_is_nothing_and_once_swaps_the_sides(normal, offset, seed):
    across = np.array(normal) + np.array([0, 0, 7.0])
    plane = Plane(across / np.linalg.norm(across), offset)
    points = np.random.default_rng(seed).normal(size=(20, 3))
    image = reflected(points, plane)
    np.testing.assert_allclose(reflected(image, plane), points, atol=1e-12)
    np.testing.assert_allclose(image @ plane.normal - offset, -(points @ plane.normal - offset), atol=1e-12)


@given(st.integers(0, 10_000))
def test_the_best_plane_is_that_of_exact_mirror_images(seed):
    random = np.random.default_rng(seed)
    normal = random.normal(size=3)
    true = Plane(normal / np.linalg.norm(normal), random.normal())
    before = random.normal(size=(30, 3)) + (true.offset_m + 5) * true.normal
    found = best_plane(reflected(before, true), before, true.normal)
    np.testing.assert_allclose(found.normal, true.normal, atol=1e-7)
    assert found.offset_m == pytest.approx(true.offset_m, abs=1e-6)


def test_no_plane_near_the_best_has_less_error():
    random = np.random.default_rng(1)
    true = Plane(np.array([0.0, 1.0, 0.0]), 0.1)
    before = random.uniform([0, 1, 0], [4, 3, 2], (50, 3))
    behind = reflected(before, true) + random.normal(0, 0.1, before.shape)
    best = best_plane(behind, before, true.normal)

    def error(plane: Plane) -> float:
        return float(((reflected(behind, plane) - before) ** 2).sum())

    for step in random.normal(0, 1e-3, (40, 4)):
        normal = best.normal + step[:3]
        assert error(Plane(normal / np.linalg.norm(normal), best.offset_m + step[3])) >= error(best)
