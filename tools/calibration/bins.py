"""Whether expected errors are right in size: expected against true error, in bins of the expected one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Lower ends of the bins.
DEPTH_BINS = (0.0, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)  # share of the depth
NORMAL_BINS = (0.0, 3.0, 6.0, 9.0, 12.0, 16.0, 24.0, 40.0)  # degrees
BINS = {"depth": DEPTH_BINS, "normal": NORMAL_BINS}
ONE_SIGMA = 68.27  # percentile of |error| that a standard deviation is


@dataclass(frozen=True)
class Errors:
    """One source's pixels of some photos.

    Attributes:
        source: its name.
        kind: "depth" or "normal".
        expected: (N,) share of the depth, or degrees; None: the source expects nothing.
        true: (N,) |error|, in the same unit.
        known: number of pixels whose truth is known, whether or not the source has them.
    """

    source: str
    kind: str
    expected: np.ndarray | None
    true: np.ndarray
    known: int


@dataclass(frozen=True)
class Bin:
    """Pixels whose expected error lies from `low` to `high`.

    Attributes:
        share: of the source's pixels.
        expected: median of the expected errors.
        median, p68: of the true errors.
    """

    low: float
    high: float
    share: float
    expected: float
    median: float
    p68: float


@dataclass(frozen=True)
class Calibration:
    """One source on one capture.

    Attributes:
        share: of the pixels whose truth is known, those that the source has.
        expected: median of the expected errors; None where nothing is expected, as `within` and `bins` then.
        median, p68: of the true errors.
        within: share of the pixels whose true error is at most the expected one: 0.68 if that is a standard deviation,
            0.5 if it is a median.
    """

    source: str
    kind: str
    share: float
    expected: float | None
    median: float
    p68: float
    within: float | None
    bins: tuple[Bin, ...]


def calibration(parts: Sequence[Errors]) -> Calibration | None:
    """The pixels of one source, of all photos together; None without any."""
    true = np.concatenate([part.true for part in parts])
    if not len(true):
        return None
    first, known = parts[0], sum(part.known for part in parts)
    median, p68 = _percentiles(true)
    share = len(true) / known
    if first.expected is None:
        return Calibration(first.source, first.kind, share, None, median, p68, None, ())
    expected = np.concatenate([part.expected for part in parts if part.expected is not None])
    within = float(np.mean(true <= expected))
    found = bins(expected, true, BINS[first.kind])
    return Calibration(first.source, first.kind, share, float(np.median(expected)), median, p68, within, found)


def bins(expected: np.ndarray, true: np.ndarray, ends: Sequence[float]) -> tuple[Bin, ...]:
    """Those that hold any pixel.

    Args:
        expected, true: (N,) errors.
        ends: lower ends of the bins, ascending from 0; the last one has no upper end.
    """
    place = np.digitize(expected, ends) - 1
    found = []
    for index, (low, high) in enumerate(zip(ends, [*ends[1:], float("inf")], strict=True)):
        here = place == index
        if here.any():
            median, p68 = _percentiles(true[here])
            found.append(Bin(low, high, float(here.mean()), float(np.median(expected[here])), median, p68))
    return tuple(found)


def _percentiles(values: np.ndarray) -> tuple[float, float]:
    median, p68 = np.percentile(values, [50.0, ONE_SIGMA])
    return float(median), float(p68)
