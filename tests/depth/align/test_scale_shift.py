"""Scale and shift are found in spite of hidden and wrong points, and not invented where points cannot tell."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.config import load_config
from room2dgs.depth.align.depths import aligned_depths
from room2dgs.depth.align.one_view import RawMap
from room2dgs.depth.align.scale_shift import MIN_POINTS, Fit, aligned_depth, fit_scale_shift, residual
from room2dgs.depth.align.usual_scale import COST, UsualScale, usual_scale
from room2dgs.geometry.camera import Camera


def points(seed: int, count: int = 200, low: float = 1.0, high: float = 5.0) -> tuple[np.random.Generator, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng, rng.uniform(low, high, count)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 20.0), st.floats(-0.4, 0.4))
def test_known_scale_and_shift_are_found_among_30_percent_outliers(seed, scale, shift):
    rng, depth = points(seed)
    prior = (depth - shift) / scale
    outliers = rng.random(len(depth)) < 0.3
    # hidden points lie behind what the prior sees
    seen = depth * np.where(outliers, rng.uniform(1.2, 3.0, len(depth)), rng.normal(1.0, 0.003, len(depth)))
    fit = fit_scale_shift(prior, seen)
    assert fit.scale == pytest.approx(scale, rel=0.01)
    assert np.abs((fit.scale * prior + fit.shift) / depth - 1.0).max() < 0.01


def test_outliers_in_disparity():
    rng, depth = points(1)
    disparity = 1.0 / depth
    prior = (disparity - 0.03) / 0.004
    seen = np.where(rng.random(len(depth)) < 0.3, disparity / rng.uniform(1.3, 3.0, len(depth)), disparity)
    fit = fit_scale_shift(prior, seen)
    assert (fit.scale, fit.shift) == (pytest.approx(0.004, rel=0.01), pytest.approx(0.03, rel=0.01))


def test_exact_points_are_fitted_exactly():
    _, depth = points(2, count=MIN_POINTS)
    fit = fit_scale_shift((depth - 0.25) / 1.7, depth)
    assert (fit.scale, fit.shift) == (pytest.approx(1.7, rel=1e-9), pytest.approx(0.25, rel=1e-8))
    assert fit.residual < 1e-9
    assert fit.points == MIN_POINTS


def test_points_at_one_depth_tell_a_scale_and_no_shift():
    rng, depth = points(3, low=2.0, high=2.02)
    prior = depth / 1.3 * rng.normal(1.0, 0.02, len(depth))
    fit = fit_scale_shift(prior, depth)
    assert fit.shift == 0.0
    assert fit.scale == pytest.approx(1.3, rel=0.01)


def test_a_constant_map_is_no_division_by_zero():
    _, depth = points(4)
    fit = fit_scale_shift(np.full_like(depth, 3.0), depth)
    assert fit.shift == 0.0
    assert fit.residual > 0.15


def test_noise_has_a_residual_that_gives_it_away():
    rng, depth = points(5)
    assert fit_scale_shift(rng.uniform(0.5, 6.0, len(depth)), depth).residual > 0.15


def test_a_reversed_map_does_not_get_a_negative_scale():
    _, depth = points(6)
    fit = fit_scale_shift(1.0 / depth, depth)
    assert fit.scale > 0
    assert fit.residual > 0.15


def test_too_few_points_give_nothing():
    _, depth = points(7, count=MIN_POINTS - 1)
    assert fit_scale_shift(depth, depth) is None


def test_the_same_points_give_the_same_bits():
    rng, depth = points(8)
    prior = depth * rng.normal(1.0, 0.05, len(depth))
    assert fit_scale_shift(prior, depth) == fit_scale_shift(prior, depth)


def test_disparity_turns_into_depth_and_what_lies_beyond_is_invalid():
    values = np.array([[1.0, 0.5, 0.0, 9.0]], np.float32)
    valid = np.array([[True, True, True, False]])
    depth = aligned_depth(values, valid, Fit(0.5, 0.0, 0.0, 20), disparity=True, max_depth_m=100.0)
    np.testing.assert_allclose(depth, [[2.0, 4.0, 0.0, 0.0]])
    behind = aligned_depth(values, valid, Fit(1.0, -0.75, 0.0, 20), disparity=False, max_depth_m=100.0)
    np.testing.assert_allclose(behind, [[0.25, 0.0, 0.0, 0.0]])


def test_residual_is_the_median_of_all_points():
    assert residual(np.array([1.0, 1.0, 1.0]), np.array([1.0, 2.0, 4.0]), 1.0, 0.0) == pytest.approx(0.5)
    assert np.isnan(residual(np.zeros(0), np.zeros(0), 1.0, 0.0))


def test_furniture_that_the_prior_takes_for_farther_away_does_not_scale_a_photo_of_a_usual_scale():
    """Most points lie on it, as before a mirror; but where all points say the same, the photo's scale is theirs."""
    rng, depth = points(6, count=400)
    before_a_mirror = rng.random(len(depth)) < 0.6
    prior = depth * np.where(before_a_mirror, 1.8, 1.0) * rng.normal(1.0, 0.03, len(depth))
    own, usual = partial(fit_scale_shift, y=depth, shift_sigma=0.1), UsualScale(1.03, COST)
    assert own(prior).scale == pytest.approx(1 / 1.8, rel=0.05)
    assert own(prior, usual=usual).scale == pytest.approx(1.0, rel=0.05)
    assert own(depth / 1.8, usual=usual).scale == pytest.approx(1.8, rel=1e-6)


def test_where_each_photo_has_its_own_scale_none_is_usual():
    """Of two kinds of photos that the network sees in two ways, neither is drawn to what lies between."""
    assert usual_scale([]) is None
    alike = usual_scale([1.0, 0.97, 1.02, 1.01, 0.55])
    assert alike.scale == 1.0 and alike.cost > 0.9 * COST
    assert usual_scale([0.7, 0.72, 0.68, 1.2, 1.25, 1.3]).cost < 0.1 * COST


def test_views_tell_each_other_the_usual_scale():
    """Of five photos one has most of its points on what the prior takes for farther away."""
    rng = np.random.default_rng(7)
    camera = Camera(np.array([[80.0, 0, 40], [0, 80, 30], [0, 0, 1]]), 80, 60, np.eye(4))
    frames = [Frame(name=str(index), camera=camera, color_path=Path(f"{index}.jpg")) for index in range(5)]
    pixel = np.stack([rng.uniform(2, 78, 400), rng.uniform(2, 58, 400)], axis=1)
    cloud = PointCloud(camera.unproject(pixel, rng.uniform(1, 5, 400)), np.zeros((400, 3), np.uint8))
    raw = {}
    for frame in frames:
        seen = seen_points(cloud, frame)
        column, row = seen.column_row
        values = np.zeros((60, 80), np.float32)
        wrong = (column < 50) & (frame.name == "3")
        values[row, column] = seen.depth * 1.25 * np.where(wrong, 1.8, 1) * rng.normal(1, 0.02, len(row))
        raw[frame.name] = RawMap(values, values > 0)
    settings_ = replace(load_config(["scene.path=a", "out=b", "prior=room_prior"]).prior.depth, meaning="metric_depth")
    _, fits = aligned_depths(frames, raw, cloud, settings_, lambda _: None)
    assert [fit.scale for fit in fits.values()] == pytest.approx([0.8] * 5, rel=0.05)
