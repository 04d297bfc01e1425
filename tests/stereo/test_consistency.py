"""How many consistent views a depth is worth, by what else speaks for it or against it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.geometry.camera import Camera
from room2dgs.stereo.consistency import calibrated_consistency

WIDTH, HEIGHT = 80, 60
K = np.array([[70.0, 0, 40], [0, 70, 30], [0, 0, 1]])
MAX = {"max_px": 1.0, "max_relative": 0.01}
INSIDE = (slice(14, -14), slice(14, -14))  # whose surroundings are in the photo, in the neighbours', too
WALL_M, THING_M = 3.0, 2.0
VIEWS = np.full((HEIGHT, WIDTH), 4, np.uint8)


def camera(x: float = 0.0) -> Camera:
    cam_from_world = np.eye(4)
    cam_from_world[0, 3] = -x
    return Camera(K, WIDTH, HEIGHT, cam_from_world)


def wall() -> np.ndarray:
    return np.full((HEIGHT, WIDTH), WALL_M, np.float32)


def slanted() -> np.ndarray:
    """A floor, whose inverse depth is linear in the image."""
    return (1 / (0.25 + 0.004 * np.arange(HEIGHT, dtype=np.float32)))[:, None].repeat(WIDTH, axis=1)


def of(depth: np.ndarray, theirs: np.ndarray, num_consistent: np.ndarray = VIEWS, others: int = 4) -> np.ndarray:
    beside = [(camera(0.02 * k), theirs) for k in range(1, others + 1)]
    return calibrated_consistency((camera(), depth), num_consistent, beside, **MAX)


@pytest.mark.parametrize("depth", [wall(), slanted()], ids=["wall", "floor"])
def test_a_surface_that_nothing_contradicts_is_worth_more_than_its_views(depth):
    assert (of(depth, depth)[INSIDE] > 6).all()


def test_more_views_are_worth_more():
    more = of(wall(), wall(), VIEWS + 2)
    assert (more[INSIDE] > of(wall(), wall())[INSIDE]).all()


def test_what_others_pass_through_is_worth_little():
    """A piece of wall taken for as near as a thing beside it."""
    thing = wall()
    thing[20:40, 30:50] = THING_M
    supported, doubted = of(thing, thing), of(thing, wall())
    middle = (slice(27, 33), slice(37, 43))
    assert (doubted[middle] + 2 <= supported[middle]).all()


def test_what_lies_behind_others_surfaces_is_worth_less():
    near = np.full((HEIGHT, WIDTH), THING_M, np.float32)
    assert (of(wall(), near)[INSIDE] < of(wall(), wall())[INSIDE]).all()


def test_scattered_depth_is_worth_nothing():
    rng = np.random.default_rng(0)
    scattered = np.where(rng.random((HEIGHT, WIDTH)) < 0.1, rng.uniform(1, 5, (HEIGHT, WIDTH)), 0).astype(np.float32)
    few = np.full((HEIGHT, WIDTH), 2, np.uint8)
    assert (of(scattered, wall(), few)[INSIDE] == 0).mean() > 0.95


def test_holes_around_take_away():
    holes = wall()
    holes[:, 41:] = 0
    assert of(holes, wall())[30, 39] < of(wall(), wall())[30, 39]


def test_larger_photos_ask_pixels_as_far_away():
    """The same wall with the same holes, at four times the size."""
    holes = np.full((240, 320), WALL_M, np.float32)
    holes[:, 164:] = 0
    twice = np.kron(holes, np.ones((2, 2), np.float32))
    large = Camera(K * [[4], [4], [1]], 320, 240, np.eye(4))
    larger = large.resized(640, 480)
    one, two = (
        calibrated_consistency((at, depth), np.full(depth.shape, 4, np.uint8), [], **MAX)
        for at, depth in ((large, holes), (larger, twice))
    )
    np.testing.assert_array_equal(two[::2, ::2][:, :150], one[:, :150])
    assert one[120, 162] < one[120, 150]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5))
def test_a_pixel_without_depth_is_worth_nothing_whatever_is_around(seed, others):
    rng = np.random.default_rng(seed)
    depth, theirs = (
        np.where(rng.random((HEIGHT, WIDTH)) < 0.7, rng.uniform(0.5, 6), 0).astype(np.float32) for _ in range(2)
    )
    num_consistent = np.where(depth > 0, rng.integers(2, 11, depth.shape), 0).astype(np.uint8)
    found = of(depth, theirs, num_consistent, others)
    assert found.dtype == np.uint8 and found.shape == depth.shape
    assert (found[depth == 0] == 0).all()
