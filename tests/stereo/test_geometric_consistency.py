"""Where views agree on a depth: the kernel against its oracle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.geometric_consistency import geometric_consistency
from tests.oracles.geometric_consistency import geometric_consistency_reference

MAX_PX, MAX_RELATIVE = 1.0, 0.02


def camera(width, height, rng, shift):
    angle = 0.05 * rng.normal()
    cam_from_world = np.eye(4)
    cam_from_world[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    cam_from_world[:3, 3] = rng.normal(size=3) * shift
    K = np.array([[0.9 * width, 0, width / 2], [0, 0.9 * width, height / 2], [0, 0, 1]])
    return Camera(K, width, height, cam_from_world)


def drawn(seed, neighbours):
    """A view and its neighbours, of several sizes, about a wall with bumps and holes; some stand behind it."""
    rng = np.random.default_rng(seed)
    views = []
    for _ in range(1 + neighbours):
        width, height = (int(side) for side in rng.integers(1, 40, 2))
        at = camera(width, height, rng, rng.choice([0.05, 0.5, 2.0]))
        depth = 2.0 + at.cam_from_world[2, 3] + 0.03 * rng.normal(size=(height, width))
        depth[rng.random(depth.shape) < 0.2] *= 1.3
        inverse = np.where((depth > 0.1) & (rng.random(depth.shape) < 0.9), 1 / depth, 0)
        views.append((at, inverse.astype(np.float32)))
    return views[0], views[1:]


def at_thresholds(view, others, factor):
    return geometric_consistency_reference(*view, others, MAX_PX * factor, MAX_RELATIVE * factor)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6))
def test_the_kernel_is_the_reference(seed, neighbours):
    """But for pixels that rounding may take to either side of a threshold, or of the border between two pixels."""
    view, others = drawn(seed, neighbours)
    found = geometric_consistency(*view, others, MAX_PX, MAX_RELATIVE)
    exact, tighter, looser = (at_thresholds(view, others, factor) for factor in (1.0, 1 - 1e-4, 1 + 1e-4))
    names = ("num_consistent", "num_seen_through", "num_hidden")
    sure = np.logical_and.reduce([getattr(tighter, name) == getattr(looser, name) for name in names])
    differs = np.logical_or.reduce([getattr(found, name) != getattr(exact, name) for name in names])
    assert (differs & sure).sum() <= 0.01 * sure.sum() + 1  # a pixel beside the border of two looks up the other one
    same = sure & ~differs
    np.testing.assert_allclose(found.inverse_depth[same], exact.inverse_depth[same], rtol=1e-5)
    # of squares' differences: their rounding, under the root
    np.testing.assert_allclose(found.sigma[same], exact.sigma[same], atol=2e-3)


def test_each_threshold_holds_by_itself():
    """A point half a pixel and one per cent off agrees only where both are allowed."""
    rng = np.random.default_rng(0)
    one, other = camera(33, 20, rng, 0.0), camera(33, 20, rng, 0.0)
    other = Camera(other.K, 33, 20, one.cam_from_world @ np.diag([1.0, 1, 1, 1]))
    moved = other.cam_from_world.copy()
    moved[0, 3] += 0.2
    other = Camera(other.K, 33, 20, moved)
    wall, nearer = (np.full((20, 33), 1 / z, np.float32) for z in (2.0, 1.98))
    inner = (slice(None), slice(6, 24))
    counts = [
        geometric_consistency(one, wall, [(other, nearer)], px, relative).num_consistent[inner]
        for px, relative in ((1.0, 0.02), (0.01, 0.02), (1.0, 0.005))
    ]
    assert (counts[0] == 1).all() and not counts[1].any() and not counts[2].any()


def test_any_number_of_threads_and_a_map_that_is_a_part_of_another_give_the_same_bits():
    view, others = drawn(5, 6)
    wide = np.zeros((2 * view[1].shape[0], 3 * view[1].shape[1]), np.float32)
    wide[::2, ::3] = view[1]
    before = _C.threads()
    try:
        runs = []
        for threads, own in ((1, view[1]), (2, view[1]), (4, wide[::2, ::3])):
            _C.set_threads(threads)
            runs.append(
                b"".join(part.tobytes() for part in geometric_consistency(view[0], own, others, MAX_PX, MAX_RELATIVE))
            )
    finally:
        _C.set_threads(before)
    assert runs[0] == runs[1] == runs[2]


def arguments(**changed):
    given = {
        "own": np.ones((3, 4), np.float32),
        "theirs": np.ones((5, 6), np.float32),
        "there": np.eye(3, 4),
        "back": np.eye(3, 4),
        "max_px": 1.0,
        "max_relative": 0.01,
        **{name: np.zeros((3, 4), np.uint8) for name in ("count", "through", "hidden")},
        **{name: np.zeros((3, 4), np.float32) for name in ("total", "squares")},
    }
    return {**given, **changed}


@pytest.mark.parametrize(
    ("changed", "error"),
    [
        ({"theirs": np.ones((0, 6), np.float32)}, ValueError),
        ({"theirs": np.ones((5, 6))}, TypeError),
        ({"there": np.eye(4)}, ValueError),
        ({"count": np.zeros((4, 3), np.uint8)}, ValueError),
        ({"total": np.zeros((3, 8), np.float32)[:, ::2]}, TypeError),
    ],
)
def test_arrays_that_do_not_fit_are_refused_and_nothing_is_written(changed, error):
    given = arguments(**changed)
    with pytest.raises(error):
        _C.agree(**given)
    assert not given["squares"].any() and not given["hidden"].any()
    _C.agree(**arguments())


def test_views_of_a_slanted_wall_say_exactly_where_it_is():
    """Between a neighbour's pixels, too: with its nearest pixel a wall at this slant is up to 0.6 % off."""
    rng = np.random.default_rng(3)
    views = []
    for _ in range(4):
        at = camera(40, 30, rng, 0.05)
        rays = np.linalg.inv(at.K) @ np.stack([*np.mgrid[:40, :30].reshape(2, -1) + 0.5, np.ones(1200)])
        normal = np.array([0.5, 0.25, -1.0])  # of the wall normal . x = -2, world frame
        turned = at.cam_from_world[:3, :3] @ normal
        offset = -2.0 + turned @ at.cam_from_world[:3, 3]
        views.append((at, ((turned @ rays) / offset).reshape(40, 30).T.astype(np.float32)))
    found = geometric_consistency(*views[0], views[1:], 1.0, 0.01)
    seen_by_all = found.num_consistent == 3
    assert seen_by_all.mean() > 0.7
    np.testing.assert_allclose(found.inverse_depth[seen_by_all], views[0][1][seen_by_all], rtol=2e-5)
