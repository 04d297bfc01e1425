"""How the errors of places on one surface hang together: a thousand pixels are not a thousand independent words."""

from __future__ import annotations

import numpy as np

CELL_M = 0.25  # faces in a square of this side share their error
RANGE_M = 0.5  # over which errors of one surface forget each other
SHARED = 0.5  # of the variance: what a whole surface shares, such as a bias of the depth


def correlation(place: np.ndarray) -> np.ndarray:
    """(K, K) of errors at places (K, 3), metres: SHARED + (1 - SHARED) exp(-distance / RANGE_M)."""
    distance = np.linalg.norm(place[:, None] - place[None], axis=-1)
    return SHARED + (1 - SHARED) * np.exp(-distance / RANGE_M)


def mean_sigma(place: np.ndarray, sigma_m: np.ndarray, weight: np.ndarray) -> float:
    """Standard deviation of the weighted mean of correlated values.

    Args:
        place: (K, 3) metres.
        sigma_m, weight: (K,) of each.
    """
    share = weight / weight.sum() * sigma_m
    return float(np.sqrt(share @ correlation(place) @ share))
