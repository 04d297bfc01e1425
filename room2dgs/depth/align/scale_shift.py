"""Scale and shift of a prior depth map against sparse points of known depth.

A network's depth is right up to a scale and a shift, in depth or in disparity (1 / depth) by the model. Points
hidden behind a surface, and wrong points, are outliers: the best of many two-point fits by a truncated cost
(MSAC, Torr and Zisserman 2000), then reweighted least squares.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.depth.align.usual_scale import UsualScale

MIN_POINTS = 10
TRIALS = 400
JUDGES = 1000  # points by which candidates are judged; all of them take part in the refinement
# A relative residual beyond this is an outlier's, whatever its size.
INLIER = 0.15
# With a scale less certain than this the points lie too nearly at one depth to tell a shift from a scale.
MAX_SCALE_ERROR = 0.2
# A network's error is smooth: a view's points are worth no more than so many independent ones.
INDEPENDENT = 16
REWEIGHTINGS = 10


class Fit(NamedTuple):
    """y = scale x + shift.

    Attributes:
        scale, shift: in depth (shift in metres) or in disparity (1 / metre).
        residual: median of |scale x + shift - y| / y over all points, outliers among them; NaN without points.
        points: their number.
    """

    scale: float
    shift: float
    residual: float
    points: int


def fit_scale_shift(
    x: np.ndarray, y: np.ndarray, seed: int = 0, shift_sigma: float | None = None, usual: UsualScale | None = None
) -> Fit | None:
    """Robust fit of y = scale x + shift, scale > 0; shift = 0 where the points do not determine it.

    The same points give the same fit.

    Args:
        x: (N,) the prior's values at the points.
        y: (N,) the points' depths or disparities, > 0.
        shift_sigma: how far from 0 the shift is expected, in y's unit; None: anywhere.
        usual: scale of the other views, which points have to speak against; None: any is as good.

    Returns:
        None with fewer than `MIN_POINTS`, or if no fit with a positive scale exists.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if len(x) < MIN_POINTS:
        return None
    candidates = np.concatenate([_two_point_fits(x, y, seed), _one_point_fits(x, y)])
    candidates = candidates[(candidates[:, 0] > 0) & np.isfinite(candidates).all(axis=1)]
    if shift_sigma is not None:
        candidates = candidates[np.abs(candidates[:, 1]) <= 3.0 * shift_sigma]
    if not len(candidates):
        return None
    judges = np.random.default_rng(seed + 1).permutation(len(x))[:JUDGES]
    some_x, some_y = x[judges], y[judges]
    relative = np.abs(candidates[:, :1] * some_x + candidates[:, 1:] - some_y) / some_y
    cost = np.minimum(relative, INLIER).mean(axis=1)
    if usual is not None:
        cost += usual.costs(candidates[:, 0] + candidates[:, 1] / np.median(some_x))
    best = candidates[cost.argmin()]
    scale, shift = _refined(x, y, best, shift_sigma)
    return Fit(scale, shift, residual(x, y, scale, shift), len(x))


def residual(x: np.ndarray, y: np.ndarray, scale: float, shift: float) -> float:
    """Median of |scale x + shift - y| / y; NaN without points."""
    return float(np.median(np.abs(scale * x + shift - y) / y)) if len(x) else float("nan")


def aligned_depth(values: np.ndarray, valid: np.ndarray, fit: Fit, disparity: bool, max_depth_m: float) -> np.ndarray:
    """Apply a fit.

    Args:
        values: (H, W) the prior's map.
        valid: (H, W) bool.
        disparity: the map and the fit are in disparity.
        max_depth_m: farther depths are invalid.

    Returns:
        (H, W) float32 metres, 0 = invalid.
    """
    fitted = fit.scale * values.astype(np.float64) + fit.shift
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = 1.0 / fitted if disparity else fitted
    with np.errstate(invalid="ignore"):
        good = valid & (fitted > 0) & (depth > 0) & (depth <= max_depth_m)
    return np.where(good, depth, 0.0).astype(np.float32)


def _two_point_fits(x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    """(TRIALS, 2) scale and shift through random pairs; not finite where a pair has one x."""
    first, second = np.random.default_rng(seed).integers(0, len(x), size=(2, TRIALS))
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = (y[second] - y[first]) / (x[second] - x[first])
        return np.stack([scale, y[first] - scale * x[first]], axis=1)


def _one_point_fits(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(at most TRIALS, 2) pure scales."""
    some = np.unique(np.linspace(0, len(x) - 1, TRIALS).astype(np.int64))
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = y[some] / x[some]
    return np.stack([scale, np.zeros_like(scale)], axis=1)


def _refined(x: np.ndarray, y: np.ndarray, start: np.ndarray, shift_sigma: float | None) -> tuple[float, float]:
    """Reweighted least squares (Tukey's biweight) of the relative residual, from a fit close to the truth."""
    scale, shift = start
    width = INLIER
    for _ in range(REWEIGHTINGS):
        relative = (scale * x + shift - y) / y
        inliers = np.abs(relative) < width
        weight = np.where(inliers, (1.0 - (relative / width) ** 2) ** 2, 0.0) / y**2
        solved = _weighted_line(x, y, weight, shift_sigma)
        if solved is None or solved[0] <= 0:
            break
        scale, shift = solved
        relative = np.abs(scale * x + shift - y) / y
        close = relative[relative < INLIER]
        if not len(close):
            break
        # 4.685 sigma: the biweight's usual width; never down to rounding
        width = min(INLIER, max(4.685 * 1.4826 * float(np.median(close)), 1e-4))
    return float(scale), float(shift)


def _weighted_line(
    x: np.ndarray, y: np.ndarray, weight: np.ndarray, shift_sigma: float | None
) -> tuple[float, float] | None:
    """Scale and shift of least weighted squares; a pure scale where the points do not determine the shift."""
    used = int((weight > 0).sum())
    if used < 2:
        return None
    xx, xy = (weight * x * x).sum(), (weight * x * y).sum()
    if not xx > 0:
        return None
    pure = xy / xx
    # both with the scale solved for: what the shift explains
    rest = (weight * (1.0 - x * (weight * x).sum() / xx)).sum()
    if not rest > 1e-12 * weight.sum():
        return pure, 0.0
    explained = (weight * (y - pure * x)).sum()
    shift = explained / rest
    scale = (xy - shift * (weight * x).sum()) / xx
    # Neighbouring points share the map's error: they count as a few independent ones, however many there are.
    variance = (weight * (scale * x + shift - y) ** 2).sum() / max(used - 2, 1)
    noise = variance * max(1.0, used / INDEPENDENT)
    if shift_sigma is not None:
        shift = explained / (rest + noise / shift_sigma**2)
    elif noise * (weight * x).sum() ** 2 / (rest * xx**2) > (MAX_SCALE_ERROR * scale) ** 2:
        shift = 0.0
    return (xy - shift * (weight * x).sum()) / xx, shift
