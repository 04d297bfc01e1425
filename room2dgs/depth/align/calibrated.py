"""How far off aligned maps are by what their network doubts: found where the photos' depth is known.

A network's confidence ranks pixels and has no unit. At the sparse points and stereo's samples of all photos the errors
of the aligned maps are known; their mean as a function of the doubt that never falls (isotonic regression) says how far
off the other pixels are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.optimize import isotonic_regression

from room2dgs import _C
from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.logs import Log
from room2dgs.parallel_map import parallel_map

BINS = 24  # of about equally many samples
ENOUGH = 200  # samples of all photos together
MOST = 0.5  # relative error that counts: a sample may be wrong, too


def calibrated_sigmas(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    doubts: Mapping[str, np.ndarray],
    points: PointCloud,
    log: Log,
) -> Mapping[str, np.ndarray]:
    """Relative standard deviations of aligned maps.

    Args:
        frames: views; those without a depth are passed over.
        depths: frame name -> (H, W) metres, 0 = invalid.
        doubts: frame name -> (H, W), larger where depth is worse.
        points: sparse points and depth samples, metres.

    Returns:
        Frame name -> (H, W) float32, made when it is asked for; none where too few samples are known.
    """
    known = [frame for frame in frames if frame.name in depths and frame.name in doubts]
    found = list(parallel_map(partial(_at_samples, depths, doubts, points), known, _C.threads()))
    doubt, error, weight = (np.concatenate([np.zeros(0), *(one[part] for one in found)]) for part in range(3))
    if (weight > 0).sum() < ENOUGH:
        log(f"depth prior: {(weight > 0).sum()} samples are too few to tell how far off its confidence means")
        return {}
    at, sigma = error_of_doubt(doubt, error, weight)
    log(f"depth prior: where it is sure it is {sigma[0]:.1%} off the samples, where it doubts {sigma[-1]:.1%}")
    sigmas: LazyMaps[np.ndarray] = LazyMaps()
    for frame in known:
        sigmas.add(frame.name, partial(_sigma, doubts, frame.name, at, sigma))
    return sigmas


def error_of_doubt(doubt: np.ndarray, error: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The error to be expected, as a function of the doubt that never falls.

    Args:
        doubt, error, weight: (N,) of samples.

    Returns:
        (M,) doubts, rising, and (M,) float64 mean errors there; in between linear, beyond constant.
    """
    doubt, error, weight = (values[weight > 0] for values in (doubt, error, weight))
    edges = np.unique(np.quantile(doubt, np.arange(1, BINS) / BINS, method="lower"))
    order = np.argsort(doubt, kind="stable")
    # what doubts alike is in one bin
    ends = np.searchsorted(doubt[order], edges, side="right")
    parts = [part for part in np.split(order, ends) if len(part)]
    total = np.array([weight[part].sum() for part in parts])
    mean = np.array([(weight[part] * error[part]).sum() for part in parts]) / total
    at = np.array([np.median(doubt[part]) for part in parts])
    return at, isotonic_regression(mean, weights=total).x


def _at_samples(
    depths: Mapping[str, np.ndarray], doubts: Mapping[str, np.ndarray], points: PointCloud, frame: Frame
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Doubt, |error of ln depth| and weight at a photo's samples, (N,) each."""
    seen = seen_points(points, frame)
    column, row = seen.column_row
    depth, doubt = depths[frame.name][row, column], doubts[frame.name][row, column]
    good = (depth > 0) & np.isfinite(doubt)
    error = np.abs(np.log(depth[good] / seen.depth[good]))
    return doubt[good], np.minimum(error, MOST), points.weight_of(seen.index)[good]


def _sigma(doubts: Mapping[str, np.ndarray], name: str, at: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    doubt = doubts[name]
    found = np.interp(np.where(np.isfinite(doubt), doubt, at[-1]), at, sigma)
    return np.where(np.isfinite(doubt), found, np.inf).astype(np.float32)
