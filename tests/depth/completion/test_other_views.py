"""What is sure in other views, projected into a view: the kernel against its oracle, and what it is for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C
from room2dgs.depth.completion.expected_sigma import expecting
from room2dgs.depth.completion.low_res import Completed
from room2dgs.depth.completion.other_views import LENDING, LendingView, depth_of_other_views
from room2dgs.geometry.camera import Camera
from tests.oracles.other_views import depth_of_other_views_reference


def camera(width, height, rng, turn=0.3, shift=0.5):
    axis = rng.normal(size=3) * turn
    angle = max(np.linalg.norm(axis), 1e-9)
    x, y, z = axis / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    world_from_cam = np.eye(4)
    world_from_cam[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    world_from_cam[:3, 3] = rng.normal(size=3) * shift
    focal = 0.8 * width
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(K, width, height, np.linalg.inv(world_from_cam))


def drawn_views(seed, count):
    """Rough depths of several sizes, with holes, and confidences on both sides of what is projected."""
    rng = np.random.default_rng(seed)
    views = []
    for _ in range(count):
        width, height = rng.integers(1, 24, 2)
        depth = rng.choice([1.5, 1.51, 2.0, 0.3], (height, width)) * rng.uniform(0.97, 1.03, (height, width))
        depth[rng.random(depth.shape) < 0.2] = 0
        sure = rng.uniform(0, 1, depth.shape)
        views.append(LendingView(camera(width, height, rng), depth.astype(np.float32), sure.astype(np.float32)))
    return views, [[k for k in rng.permutation(count) if k != view] for view in range(count)]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_the_kernel_is_the_reference(seed, count):
    views, near = drawn_views(seed, count)
    for view, (depth, trust) in enumerate(depth_of_other_views(views, near)):
        expected, of = depth_of_other_views_reference(views, view, near[view])
        assert depth.shape == trust.shape == views[view].depth.shape
        np.testing.assert_allclose(depth, expected, rtol=1e-6)
        np.testing.assert_allclose(trust, of, rtol=1e-6, atol=1e-9)


def test_any_number_of_threads_gives_the_same_bits():
    views, near = drawn_views(3, 8)
    before = _C.threads()
    try:
        runs = []
        for threads in (1, 2, 4):
            _C.set_threads(threads)
            runs.append(np.concatenate([part.ravel() for one in depth_of_other_views(views, near) for part in one]))
    finally:
        _C.set_threads(before)
    assert runs[0].any() and all(np.array_equal(run, runs[0]) for run in runs)


@pytest.fixture
def wall():
    """Six views of a wall at z = 2 m, side by side, and what each knows of it."""
    rng = np.random.default_rng(0)
    views = []
    for k in range(6):
        at = camera(40, 30, rng, turn=0.0, shift=0.0)
        cam_from_world = np.eye(4)
        cam_from_world[:3, 3] = [-0.05 * k, -0.02 * k, 0.0]
        at = Camera(at.K, 40, 30, cam_from_world)
        views.append(LendingView(at, np.full((30, 40), 2, np.float32), np.full((30, 40), 0.9, np.float32)))
    return views


def everyone(views):
    return [[k for k in range(len(views)) if k != view] for view in range(len(views))]


def test_a_wrong_view_hears_what_the_others_know(wall):
    views = [wall[0]._replace(depth=np.full((30, 40), 3, np.float32)), *wall[1:]]
    depth, trust = depth_of_other_views(views, everyone(views))[0]
    assert np.abs(depth[3:20, 3:30] - 2).max() < 1e-5
    # all of five votes of 0.9 agree
    assert trust[10, 15] == pytest.approx(0.9 * 4.5 / 5.5, rel=1e-5)


def test_one_wrong_view_among_many_is_outvoted_and_costs_trust(wall):
    views = [*wall[:5], wall[5]._replace(depth=np.full((30, 40), 2.3, np.float32))]
    depth, trust = depth_of_other_views(views, everyone(views))[0]
    assert np.abs(depth[3:18, 3:26] - 2).max() < 1e-5
    assert trust[10, 15] == pytest.approx(0.9 * 3.6 / 4.5 * 3.6 / 4.6, rel=1e-5)


def test_what_is_unsure_unknown_or_behind_the_camera_has_no_vote(wall):
    none = np.zeros((30, 40), np.float32)
    past_the_wall = np.eye(4)
    past_the_wall[2, 3] = -5.0
    at = Camera(wall[0].camera.K, 40, 30, past_the_wall)
    for silent in (
        wall[1]._replace(weight=np.full((30, 40), 0.19, np.float32)),
        wall[1]._replace(depth=none),
        wall[1]._replace(depth=np.full((30, 40), np.nan, np.float32)),
        wall[1]._replace(weight=np.full((30, 40), np.nan, np.float32)),
        wall[1]._replace(depth=np.full((30, 40), np.inf, np.float32)),
    ):
        depth, trust = depth_of_other_views([wall[0], silent], [[1], []])[0]
        assert not depth.any() and not trust.any()
    depth, _ = depth_of_other_views([wall[0]._replace(camera=at), wall[1]], [[1], []])[0]
    assert not depth.any()


def test_no_more_than_the_first_are_asked_and_nobody_is_no_error(wall):
    views = [wall[0], *(LENDING * [wall[1]._replace(weight=np.zeros((30, 40), np.float32))]), wall[2]]
    depth, _ = depth_of_other_views(views, [list(range(1, len(views))), *([[]] * (len(views) - 1))])[0]
    assert not depth.any()
    assert depth_of_other_views([], []) == []
    depth, trust = depth_of_other_views(wall[:1], [[]])[0]
    assert not depth.any() and not trust.any()


def arguments(**changed):
    pixels = np.ones(24, np.float32)
    given = {
        "depth": pixels,
        "sure": pixels.copy(),
        "size": np.array([[3, 4], [3, 4]], np.int64),
        "near": np.array([[1], [0]], np.int64),
        "warp": np.zeros((2, 1, 3, 4)),
        "least": 0.2,
        "same": 0.02,
        "result": np.empty(24, np.float32),
        "trust": np.empty(24, np.float32),
    }
    return {**given, **changed}


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"size": np.array([[3, 4], [3, 5]], np.int64)}, "the views 27"),
        ({"size": np.array([[3, 4], [-3, -4]], np.int64)}, "not of 1 to 2"),
        ({"near": np.array([[1], [2]], np.int64)}, "a view that is not there"),
        ({"near": np.array([[-2], [0]], np.int64)}, "a view that is not there"),
        ({"same": 0.0}, "same"),
        ({"least": float("nan")}, "least"),
        ({"warp": np.zeros((2, 2, 3, 4))}, "warp has shape"),
    ],
)
def test_the_binding_refuses_what_does_not_fit(changed, sentence):
    with pytest.raises(ValueError, match=sentence):
        _C.depth_of_other_views(**arguments(**changed))


def test_what_others_moved_is_expected_to_be_off_by_half_of_it_more(wall):
    """What is moved is neither confirmed by those who moved it nor as sure as it was."""
    blank = np.zeros((30, 40), np.float32)
    alone = [Completed(view.camera, blank, blank, blank, view.depth, blank) for view in wall]
    moved = [alone[0]._replace(log_scale=blank + np.float32(0.1), depth=alone[0].depth * np.float32(1.105)), *alone[1:]]
    before, after = (
        list(map(expecting(views, alone, everyone(wall), None), range(len(views)))) for views in (alone, moved)
    )
    np.testing.assert_allclose(after[0] - before[0], 0.05, rtol=1e-3)
    assert all(np.array_equal(one, other) for one, other in zip(before[1:], after[1:], strict=True))
