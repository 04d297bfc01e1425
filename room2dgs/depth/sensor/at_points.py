"""A photo's depth file against the sparse points that the photo sees, also with the map moved by some pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.captures.seen_points import SeenPoints

REACH = 0.025  # of the photo's width: so far the map is moved to either side
STEPS = 8  # at most, to either side
FAR_OFF = 0.03  # relative residuals count up to this; wrong points would drown a small shift otherwise


class AtPoints(NamedTuple):
    """N points that a photo sees where its map has a depth.

    Attributes:
        ratio: (N,) depth of the map over depth of the point.
        moved_off: (S, S) mean truncated residual with the map moved by (row, column) of `moves`, each
            divided by the median ratio that it has then; NaN where too few points have a depth then.
    """

    ratio: np.ndarray
    moved_off: np.ndarray

    @property
    def median(self) -> float:
        """Of the ratios; NaN without points."""
        return float(np.median(self.ratio)) if len(self.ratio) else float("nan")

    @property
    def residual(self) -> float:
        """Median |ratio - 1|; NaN without points."""
        return float(np.median(np.abs(self.ratio - 1.0))) if len(self.ratio) else float("nan")


def moves(width: int) -> np.ndarray:
    """(S,) whole pixels by which maps are moved along each axis, 0 in the middle."""
    reach = max(2.0, REACH * width)
    step = max(1, round(reach / STEPS))
    steps = round(reach / step)
    return step * np.arange(-steps, steps + 1)


def at_points(depth: np.ndarray, seen: SeenPoints) -> AtPoints:
    """Compare.

    Args:
        depth: (H, W) z-depth, metres, at the photo's size; 0 = invalid.
        seen: what the photo sees.
    """
    ratio, known = _ratios(depth, seen, 0, 0)
    by = moves(depth.shape[1])
    off = np.full((len(by), len(by)), np.nan)
    for i, down in enumerate(by):
        for j, right in enumerate(by):
            moved, there = _ratios(depth, seen, down, right)
            if 2 * there.sum() >= known.sum() > 0:
                scaled = moved[there] / np.median(moved[there])
                off[i, j] = np.minimum(np.abs(scaled - 1.0), FAR_OFF).mean()
    return AtPoints(ratio[known], off)


def _ratios(depth: np.ndarray, seen: SeenPoints, down: int, right: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) depth over the point's, the map moved, and (N,) bool where there is a depth."""
    column, row = seen.column_row
    row, column = row - down, column - right
    height, width = depth.shape
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    value = np.where(inside, depth[row.clip(0, height - 1), column.clip(0, width - 1)], 0.0)
    return value / seen.depth, value > 0
