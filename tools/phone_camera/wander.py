"""Exposure and white balance that wander along a walk."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

SMOOTH = 2.0  # photos over which the metering changes its mind
COLOUR = 0.25  # of the wander: what red and blue have of their own, against green
WITHIN = 1.645  # deviations that nine of ten are within
LEVELS = 2.2  # power from levels to light


def wandering_gains(photos: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """(photos, 3) factors of the levels of red, green and blue, of geometric mean 1 over the photos.

    Args:
        share: by which nine photos of ten are within, both ways: 0.25 is from 1 / 1.25 to 1.25.
        rng: draws them.
    """
    smooth = gaussian_filter1d(rng.normal(size=(photos + 40, 4)), SMOOTH, axis=0, mode="wrap")[:photos]
    # half of it by photo: a lamp that comes into view, a face, a tap
    drawn = smooth / np.sqrt(0.5 / (SMOOTH * np.sqrt(np.pi))) + rng.normal(size=(photos, 4))
    drawn = drawn / np.sqrt(2)
    steps = drawn[:, :1] + COLOUR * drawn[:, 1:] * np.array([1, 0, 1])
    steps = np.log1p(share) / WITHIN * steps
    return np.exp(steps - steps.mean(axis=0))


def of_light(gains: np.ndarray) -> np.ndarray:
    """Factors of the light that change levels by `gains`."""
    return gains**LEVELS
