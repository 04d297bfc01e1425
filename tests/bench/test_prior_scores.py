"""Alignment, angles and rankings of priors, against what can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.bench.prior_scores import (
    MAX_DEPTH_M,
    aligned,
    angles_deg,
    best_constant,
    depth_score,
    normal_scores,
    ranking,
)

RNG = np.random.default_rng(0)
TRUTH = RNG.uniform(1.0, 5.0, 500)


@given(scale=st.floats(0.01, 100), shift=st.floats(-3, 3))
def test_scale_and_shift_are_taken_out_in_the_priors_own_quantity(scale, shift):
    depth, disparity = (TRUTH - shift) / scale, (1 / TRUTH - shift) / scale
    np.testing.assert_allclose(aligned(depth, TRUTH, False, True), TRUTH, rtol=1e-6)
    np.testing.assert_allclose(aligned(disparity, TRUTH, True, True), TRUTH, rtol=1e-6)


def test_a_scale_alone_leaves_a_shift_in_and_is_not_moved_by_outliers():
    np.testing.assert_allclose(aligned(3 * TRUTH, TRUTH, False, False), TRUTH)
    np.testing.assert_allclose(aligned(3 / TRUTH, TRUTH, True, False), TRUTH)
    assert depth_score(aligned(TRUTH + 1, TRUTH, False, False), TRUTH).abs_rel > 0.05
    spoilt = 3 * TRUTH
    spoilt[:200] *= 50
    np.testing.assert_allclose(aligned(spoilt, TRUTH, False, False)[200:], TRUTH[200:], rtol=1e-6)


def test_depth_that_cannot_be_stays_a_finite_error():
    disparity = 1 / TRUTH
    disparity[0] = -5.0
    depth = aligned(disparity, TRUTH, True, False)
    assert depth[0] == pytest.approx(MAX_DEPTH_M)
    assert aligned(np.zeros(0), np.zeros(0), True, True).shape == (0,)
    same = aligned(np.full(500, 2.0), TRUTH, False, True)
    np.testing.assert_allclose(same, TRUTH.mean())


def test_depth_score_by_hand():
    score = depth_score(np.array([1.0, 2.6, 3.0, 0.7]), np.array([1.0, 2.0, 4.0, 1.0]))
    assert score.abs_rel == pytest.approx((0 + 0.3 + 0.25 + 0.3) / 4)
    assert score.delta1 == 0.25  # 4 / 3 is over 1.25 though 3 is only 25 % off


def test_angles_near_0_and_180_degrees():
    turn = np.radians(1e-4)
    first = np.array([[0, 0, -1.0], [1, 0, 0], [0, 1, 0]])
    second = np.array([[np.sin(turn), 0, -np.cos(turn)], [-1, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(angles_deg(first, second), [1e-4, 180, 90], rtol=1e-6)


def test_normal_scores_by_hand():
    scores = normal_scores(np.array([0.0, 11.25, 20.0, 29.0, 90.0]))
    assert scores["mean_deg"] == pytest.approx(30.05)
    assert scores["median_deg"] == 20.0
    assert (scores["under_11.25"], scores["under_22.5"], scores["under_30"]) == (0.2, 0.6, 0.8)


@given(st.integers(0, 2**32 - 1))
def test_no_other_constant_normal_is_better(seed):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(60, 3)) + np.array([0.5, -1.0, -2.0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    best = best_constant(normals)
    assert np.linalg.norm(best) == pytest.approx(1.0)
    mean = angles_deg(normals, best).mean()
    for size in (0.003, 0.03, 0.3):
        other = best + size * rng.normal(size=(20, 3))
        other /= np.linalg.norm(other, axis=1, keepdims=True)
        assert all(angles_deg(normals, one).mean() > mean - 0.01 for one in other)


def test_the_best_constant_is_the_majority_and_not_the_mean():
    wall, floor = np.array([0, 0, -1.0]), np.array([0, -1.0, 0])
    normals = np.concatenate([np.tile(wall, (70, 1)), np.tile(floor, (30, 1))])
    assert angles_deg(best_constant(normals)[None], wall)[0] < 2.0


def test_a_perfect_ranking_has_no_area_and_its_half_is_the_best_half():
    error = RNG.exponential(size=4000)
    found = ranking(error**2, error)  # any rising function of the error
    assert found.ause == pytest.approx(0.0, abs=1e-9)
    assert found.confident_half == found.best_half == pytest.approx(np.sort(error)[:2000].mean())
    assert found.all == pytest.approx(error.mean())


def test_a_constant_or_random_ranking_gains_nothing_and_a_wrong_one_is_worse():
    error = RNG.exponential(size=4000)
    constant = ranking(np.full(4000, 0.3), np.sort(error))
    assert constant.ause == pytest.approx(constant.ause_random)
    assert constant.confident_half == pytest.approx(constant.all)
    assert constant.expected == pytest.approx(0.3)
    chance = ranking(RNG.random(4000), error)
    assert chance.ause == pytest.approx(chance.ause_random, abs=0.05)
    assert ranking(-error, error).ause > 1.2 * constant.ause_random


def test_tenths_say_whether_the_size_of_the_expected_error_is_right():
    expected = RNG.uniform(0.1, 1.0, 20_000)
    found = ranking(expected, expected * RNG.exponential(size=20_000))
    assert len(found.bins) == 10
    for mean_expected, mean_error in found.bins:
        assert mean_error == pytest.approx(mean_expected, rel=0.1)
    assert found.bins[0][0] < found.bins[-1][0]


def test_too_few_pixels_rank_nothing():
    assert ranking(np.ones(9), np.ones(9)) is None
    assert np.isnan(depth_score(np.zeros(0), np.zeros(0)).abs_rel)
