"""How good a prior's depth and normals are, and whether its expected errors tell where it is wrong.

All functions take plain arrays of pixels, so that they serve one frame or all frames pooled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Aligned depth is cut off there: a disparity near 0 stays a finite error.
MIN_DEPTH_M, MAX_DEPTH_M = 1e-3, 20.0
DELTA1 = 1.25
NORMAL_SHARES_DEG = (11.25, 22.5, 30.0)
SPARSIFICATION_STEPS = 100
CALIBRATION_BINS = 10


@dataclass(frozen=True)
class DepthScore:
    """Of one frame's aligned depth.

    Attributes:
        abs_rel: mean |d - d*| / d*.
        delta1: share of pixels with max(d / d*, d* / d) < 1.25.
    """

    abs_rel: float
    delta1: float


@dataclass(frozen=True)
class Ranking:
    """Whether expected errors rank the true ones.

    Attributes:
        all, confident_half: mean true error of all pixels, and of the half with the smallest expected error.
        best_half: mean true error of the half that is truly best: no ranking gives less.
        ause: area between the curve of the mean error of what is left when the most doubtful share is taken away, and
            the same by the true error; as a share of the mean error. 0: ranks perfectly; `ause_random`: knows nothing.
        ause_random: the same for an order that has nothing to do with the errors.
        expected: mean expected error; the same as `all` if its size is right.
        bins: (mean expected, mean true error) by tenths of the expected error, least first.
        curve, best_curve: mean error of what is left, as a share of `all`, from nothing to nearly all taken away.
    """

    all: float
    confident_half: float
    best_half: float
    ause: float
    ause_random: float
    expected: float
    bins: tuple[tuple[float, float], ...]
    curve: tuple[float, ...]
    best_curve: tuple[float, ...]


def depth_score(depth: np.ndarray, truth: np.ndarray) -> DepthScore:
    """Scores of positive depths (N,) against the true ones; NaN without pixels."""
    if not len(depth):
        return DepthScore(float("nan"), float("nan"))
    ratio = depth / truth
    return DepthScore(float(np.abs(ratio - 1.0).mean()), float((np.maximum(ratio, 1.0 / ratio) < DELTA1).mean()))


def aligned(values: np.ndarray, truth: np.ndarray, disparity: bool, with_shift: bool) -> np.ndarray:
    """A prior's values (N,) brought to metres against the true depth of the same pixels.

    With a shift: scale and shift of least squares in the prior's own quantity, depth or disparity (1 / depth), every
    pixel with the same weight, as Ranftl et al. 2020 (MiDaS) have it. Without: the median ratio of truth to prior in
    that quantity, which outliers do not move (Zhou et al. 2017).

    Args:
        values: (N,) depth or disparity, up to scale (and shift).
        truth: (N,) metres, > 0.

    Returns:
        (N,) float64 metres, from 1 mm to `MAX_DEPTH_M`.
    """
    values, truth = values.astype(np.float64), truth.astype(np.float64)
    if not len(values):
        return values
    wanted = 1.0 / truth if disparity else truth
    if with_shift:
        columns = np.stack([values, np.ones_like(values)], axis=1)
        fitted = columns @ np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
    else:
        fitted = np.median(wanted / values) * values
    if disparity:
        fitted = 1.0 / np.maximum(fitted, 1.0 / MAX_DEPTH_M)
    return np.clip(fitted, MIN_DEPTH_M, MAX_DEPTH_M)


def angles_deg(normal: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(N,) degrees between unit vectors (N, 3)."""
    # exact near 0, where the cosine's rounding alone is 0.02 degrees in float32
    chord = np.linalg.norm(normal.astype(np.float64) - truth, axis=-1)
    return np.degrees(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))


def normal_scores(angles: np.ndarray) -> dict[str, float]:
    """mean_deg, median_deg and the shares under 11.25, 22.5 and 30 degrees (NaN without pixels)."""
    if not len(angles):
        return dict.fromkeys(("mean_deg", "median_deg", *map(share_name, NORMAL_SHARES_DEG)), float("nan"))
    shares = {share_name(limit): float((angles < limit).mean()) for limit in NORMAL_SHARES_DEG}
    return {"mean_deg": float(angles.mean()), "median_deg": float(np.median(angles)), **shares}


def share_name(limit: float) -> str:
    """11.25 -> "under_11.25"."""
    return f"under_{limit:g}"


def best_constant(normals: np.ndarray, rounds: int = 50) -> np.ndarray:
    """(3,) the one unit vector of least mean angle to unit vectors (N, 3): their geometric median on the sphere.

    By Weiszfeld's steps in the tangent plane, from the mean.
    """
    centre = normals.mean(axis=0)
    centre = centre / max(np.linalg.norm(centre), 1e-12)
    for _ in range(rounds):
        cosine = (normals @ centre).clip(-1.0, 1.0)
        angle = np.arccos(cosine)
        across = normals - cosine[:, None] * centre
        weight = 1.0 / np.maximum(np.sin(angle), 1e-3)
        # log map divided by the angle: a unit step towards each vector
        step = (across * weight[:, None]).sum(axis=0) / (1.0 / np.maximum(angle, 1e-3)).sum()
        size = np.linalg.norm(step)
        if size < 1e-6:
            break
        centre = np.cos(size) * centre + np.sin(size) * step / size
        centre = centre / np.linalg.norm(centre)
    return centre


def ranking(expected: np.ndarray, error: np.ndarray) -> Ranking | None:
    """How well expected errors (N,) tell the true ones (N,); None with fewer than ten pixels.

    Pixels with equal expected errors count with their mean error, so that a constant ranks nothing and gains nothing.
    """
    if len(error) < CALIBRATION_BINS:
        return None
    expected, error = expected.astype(np.float64), error.astype(np.float64)
    ranked = error[np.argsort(expected, kind="stable")]
    ranked = _ties_averaged(np.sort(expected, kind="stable"), ranked)
    best = np.sort(error)
    mean = float(error.mean())
    curve, best_curve = _left(ranked), _left(best)
    scale = mean if mean > 0 else 1.0
    half = max(1, len(error) // 2)
    order = np.argsort(expected, kind="stable")
    bins = tuple((float(expected[part].mean()), float(error[part].mean())) for part in _tenths(order))
    return Ranking(
        all=mean,
        confident_half=float(ranked[:half].mean()),
        best_half=float(best[:half].mean()),
        ause=float((curve - best_curve).mean() / scale),
        ause_random=float((mean - best_curve).mean() / scale),
        expected=float(expected.mean()),
        bins=bins,
        curve=tuple((curve / scale).round(5).tolist()),
        best_curve=tuple((best_curve / scale).round(5).tolist()),
    )


def _left(error: np.ndarray) -> np.ndarray:
    """(SPARSIFICATION_STEPS,) mean of what is left when the last 0, 1/100, ..., 99/100 are taken away."""
    means = np.cumsum(error) / np.arange(1, len(error) + 1)
    shares = 1.0 - np.arange(SPARSIFICATION_STEPS) / SPARSIFICATION_STEPS
    return means[np.maximum(np.ceil(shares * len(error)).astype(np.int64), 1) - 1]


def _ties_averaged(keys: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values whose sorted keys are equal replaced by their mean."""
    first = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]]))
    counts = np.diff(np.append(first, len(keys)))
    return np.repeat(np.add.reduceat(values, first) / counts, counts)


def _tenths(order: np.ndarray) -> list[np.ndarray]:
    return np.array_split(order, CALIBRATION_BINS)
