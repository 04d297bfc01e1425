"""Gains of made observations: as they were made, whatever is wrong with some of them."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.exposure.gains import Observed, estimated_gains

VIEWS, PLACES = 20, 400


def made(seed: int = 0, noise: float = 0.02, wrong: float = 0.0, spread: float = 0.15):
    """Observations of a walk: each place is seen by a few neighbouring photos; and the true logarithms of the gains."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(0, spread, (VIEWS, 3))
    truth -= truth.mean(axis=0)
    first = rng.integers(0, VIEWS - 3, PLACES)
    place = np.repeat(np.arange(PLACES), 4)
    view = first[place] + np.tile(np.arange(4), PLACES)
    color = rng.uniform(30, 180, (PLACES, 3))[place] * np.exp(truth[view] + rng.normal(0, noise, (len(view), 3)))
    bad = rng.random(len(view)) < wrong
    color[bad] = rng.uniform(20, 240, (bad.sum(), 3))
    return Observed(view, place, color, np.ones((len(view), 3))), truth


def test_known_gains_are_found_and_their_mean_is_one():
    seen, truth = made()
    found = estimated_gains(seen, VIEWS)
    assert np.abs(found.log - truth).max() < 0.02
    assert np.abs(found.log.mean(axis=0)).max() < 1e-12
    # and the expected errors are about those
    assert 0.5 < np.sqrt(np.mean(((found.log - truth) / found.error) ** 2)) < 3
    assert found.noise == pytest.approx(0.02, rel=0.4)


def test_a_third_of_wrong_tracks_does_little():
    seen, truth = made(wrong=1 / 3)
    assert np.abs(estimated_gains(seen, VIEWS).log - truth).max() < 0.04


def test_clipped_levels_that_have_no_weight_do_not_darken_an_overexposed_photo():
    seen, truth = made()
    bright = np.where(seen.view == 3, 3.0, 1.0)[:, None] * seen.color
    truth = truth + np.where(np.arange(VIEWS) == 3, np.log(3), 0)[:, None]
    truth -= truth.mean(axis=0)
    unclipped = (bright < 255).astype(float)
    color = np.minimum(bright, 255)
    found = estimated_gains(Observed(seen.view, seen.place, color, unclipped), VIEWS)
    assert np.abs(found.log - truth).max() < 0.03
    blind = estimated_gains(Observed(seen.view, seen.place, color, np.ones_like(color)), VIEWS)
    assert (blind.log - truth)[3].min() < -0.1


def test_a_photo_that_shares_no_place_stays_at_the_mean():
    seen, _ = made()
    found = estimated_gains(seen, VIEWS + 1)
    assert np.abs(found.log[VIEWS]).max() < 0.01
    assert found.error[VIEWS].min() > 0.2 > found.error[:VIEWS].max()
    lone = Observed(np.array([0, 1]), np.array([0, 1]), np.full((2, 3), [50.0, 90.0, 120.0]), np.ones((2, 3)))
    assert not estimated_gains(lone, 2).log.any()
    nothing = Observed(*np.zeros((2, 0), int), np.zeros((0, 3)), np.zeros((0, 3)))
    assert not estimated_gains(nothing, 3).log.any()


def test_constant_photos_have_gains_within_the_noise():
    seen, _ = made(spread=0.0)
    assert np.abs(estimated_gains(seen, VIEWS).log).max() < 0.02


def test_the_order_of_the_observations_does_not_matter():
    seen, _ = made(wrong=0.1)
    turned = Observed(*(values[::-1] for values in seen))
    assert estimated_gains(turned, VIEWS).log == pytest.approx(estimated_gains(seen, VIEWS).log, abs=1e-6)
