"""The scale that the depth prior usually has in a capture, for the photos whose points leave the choice."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

# What a factor of e from the usual scale costs, where a point costs its relative residual, at most 0.15: a mirror makes
# a network take the furniture before it for far away, and most of a photo's points may lie there.
COST = 0.1
SPREAD = 0.1  # deviation of ln of the scales that halves the cost: where each photo has its own, none is usual


class UsualScale(NamedTuple):
    """Median of the views' scales, and what a factor of e from it costs."""

    scale: float
    cost: float

    def costs(self, factors: np.ndarray) -> np.ndarray:
        """Of (N,) factors from prior to points; inf where one is not positive."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(factors > 0, self.cost * np.log(factors / self.scale) ** 2, np.inf)


def usual_scale(scales: Sequence[float]) -> UsualScale | None:
    """Of views that were aligned each by itself; the spread is the median deviation, which a few odd ones leave alone.

    Args:
        scales: > 0; none: None.
    """
    if not scales:
        return None
    away = np.log(scales) - np.log(np.median(scales))
    spread = 1.4826 * float(np.median(np.abs(away)))
    return UsualScale(float(np.median(scales)), COST / (1 + (spread / SPREAD) ** 2))
