"""How far off a completed depth is to be expected, from what speaks for it and against it."""

from __future__ import annotations

import cv2
import numpy as np

from room2dgs.stereo.geometric_consistency import GeometricConsistency

# Relative standard deviations, set by hand from the median errors of such pixels on two captures, greywhite, which
# NEAR_SAMPLES follows closely, and redkitchen, whose errors are about twice as large; not calibrated on others.
# Columns: how many of ten other views are consistent, 0 or 1, 2 or 3, 4 to 6, 7 or more.
COUNTS = (2, 4, 7)
# No depth sample near.
FAR_FROM_SAMPLES = np.array([0.13, 0.014, 0.009, 0.009], np.float32)
# Depth samples near, by their weight; rows: what share of them the depth contradicts.
SHARES = np.array([0.0, 0.1, 0.3, 0.5, 0.7, 1.0])
NEAR_SAMPLES = np.array(
    [
        [0.015, 0.005, 0.004, 0.004],
        [0.060, 0.011, 0.007, 0.007],
        [0.085, 0.027, 0.012, 0.010],
        [0.105, 0.048, 0.023, 0.014],
        [0.110, 0.065, 0.036, 0.020],
        [0.130, 0.090, 0.050, 0.035],
    ],
    np.float32,
)
REACH = 4.0  # pixels: deviation of the Gaussian with which a sample speaks for what is around it
ENOUGH = 0.3  # mean weight of the samples around a pixel that counts as near
OFF = 0.03  # relative difference at which a depth contradicts a sample
# Added where views contradict and none is consistent; set by hand, with the first row of NEAR_SAMPLES, on the true
# errors of bathroom, greywhite, redkitchen and two rooms of the suite.
CONTRADICTED = 0.13
CONSISTENT = 1.6  # how many views that look through a depth one consistent view outweighs
HIDING = 0.1  # what a view from which something nearer hides the depth counts of one that looks through it
ALONE = 0.25  # how many of these it takes against a depth that nobody confirms, to half of what is added
SEEN_THROUGH = 0.1  # added where all other views look through it
LEAST_ERROR = 1e-4  # relative, where differences are taken over an error: 0 / 0 would be no number


def expected_relative_error(
    completed: np.ndarray, sample: np.ndarray, weight: np.ndarray, others: GeometricConsistency, through: np.ndarray
) -> np.ndarray:
    """(h, w) float32.

    Args:
        completed: (h, w) metres.
        sample: (h, w) metres, 0 = none.
        weight: (h, w) of the samples, 0..1.
        others: what ten other views' depth says of it.
        through: (h, w) share of all other views' word that there is nothing (`free_space.seen_through`).
    """
    known = (sample > 0) & (completed > 0)  # a sample in a hole of the prior tells nothing of what is around
    off = known & (np.abs(sample / np.maximum(completed, 1e-6) - 1) > OFF)
    around = [cv2.GaussianBlur(part.astype(np.float32), (0, 0), REACH) for part in (weight * known, weight * off)]
    share = around[1] / np.maximum(around[0], 1e-6)
    near = np.clip(around[0] / ENOUGH, 0, 1)
    column = np.digitize(others.num_consistent, COUNTS)
    place = np.clip(np.interp(share, SHARES, np.arange(len(SHARES))), 0, len(SHARES) - 1)
    below = np.minimum(place.astype(np.int64), len(SHARES) - 2)
    part = place - below
    by_samples = NEAR_SAMPLES[below, column] * (1 - part) + NEAR_SAMPLES[below + 1, column] * part
    against = others.num_seen_through + HIDING * others.num_hidden
    contradicted = against / (against + CONSISTENT * others.num_consistent + ALONE)
    error = (
        FAR_FROM_SAMPLES[column] * (1 - near)
        + by_samples * near
        + CONTRADICTED * contradicted
        + SEEN_THROUGH * through**2
    )
    return error.astype(np.float32)
