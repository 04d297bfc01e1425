"""How many views are believed about depth that wide windows found."""

from __future__ import annotations

import numpy as np

from room2dgs.stereo.contrast import BESIDE_PX, HALF, discounted_by_contrast

EIGHT = np.full((40, 60), 8, np.uint8)


def test_all_are_on_a_blank_wall_and_none_is_lost_to_a_grey_level():
    wall = np.full((40, 60), 130, np.uint8)
    wall[:, 30:] += 1
    np.testing.assert_array_equal(discounted_by_contrast(EIGHT, wall), EIGHT)


def test_few_are_beside_an_edge_and_all_away_from_it():
    photo = np.full((40, 60), 60, np.uint8)
    photo[:, 30:] = 60 + 3 * int(HALF)  # a tenth
    found = discounted_by_contrast(EIGHT, photo)
    near = slice(31 - BESIDE_PX, 29 + BESIDE_PX)  # but for what the blur takes
    assert (found[:, near] == 1).all()
    assert (found[:, : 30 - BESIDE_PX - 2] == 8).all() and (found[:, 30 + BESIDE_PX + 2 :] == 8).all()


def test_half_of_them_are_at_the_contrast_that_halves():
    photo = np.full((40, 60), 60, np.uint8)
    photo[:, 30:] = 60 + int(HALF)
    assert (discounted_by_contrast(EIGHT, photo)[:, 30] == 4).all()


def test_noise_is_no_contrast():
    noisy = np.clip(np.random.default_rng(0).normal(128, 2, (40, 60)).round(), 0, 255).astype(np.uint8)
    assert discounted_by_contrast(EIGHT, noisy).min() >= 7
