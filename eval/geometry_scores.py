"""Distances between two surfaces, and the scores made of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

LARGEST_LATTICE = 2.0**62  # cells that can be numbered
ALSO_AT_M = (0.01, 0.02, 0.05, 0.10)  # reported beside the protocol's own threshold


@dataclass(frozen=True)
class AtThreshold:
    """Shares of points nearer than a threshold (strictly).

    Attributes:
        precision: share of the prediction's points; 0 without points.
        recall: share of the ground truth's points.
    """

    threshold_m: float
    precision: float
    recall: float

    @property
    def f_score(self) -> float:
        """Harmonic mean of precision and recall; 0 where both are 0."""
        total = self.precision + self.recall
        return 2 * self.precision * self.recall / total if total > 0 else 0.0


@dataclass(frozen=True)
class Scores:
    """Scores of a mesh by one protocol; a distance is None without points to measure it.

    Attributes:
        accuracy_m: mean distance from prediction to ground truth, metres.
        completion_m: mean distance from ground truth to prediction, metres.
        normal_consistency: mean |cosine| between the normals at nearest points, averaged over both directions;
            None for protocols that know no normals.
        at: by rising threshold.
    """

    accuracy_m: float | None
    completion_m: float | None
    normal_consistency: float | None
    at: tuple[AtThreshold, ...]

    @property
    def chamfer_m(self) -> float | None:
        """Mean of accuracy and completion, metres."""
        if self.accuracy_m is None or self.completion_m is None:
            return None
        return (self.accuracy_m + self.completion_m) / 2

    def as_dict(self) -> dict[str, float | None]:
        """Keys of metrics.json: accuracy_m, completion_m, chamfer_m, normal_consistency, f_score_5cm, ..."""
        values = {
            "accuracy_m": self.accuracy_m,
            "completion_m": self.completion_m,
            "chamfer_m": self.chamfer_m,
            "normal_consistency": self.normal_consistency,
        }
        for at in self.at:
            name = threshold_name(at.threshold_m)
            values[f"f_score_{name}"] = at.f_score
            values[f"precision_{name}"] = at.precision
            values[f"recall_{name}"] = at.recall
        return values


def threshold_name(threshold_m: float) -> str:
    """0.05 -> "5cm", 0.025 -> "2.5cm"."""
    return f"{round(threshold_m * 100, 6):g}cm"


def scores(
    pred_to_gt: np.ndarray,
    gt_to_pred: np.ndarray,
    threshold_m: float,
    normal_consistency: float | None = None,
) -> Scores:
    """Scores from the two sets of distances (metres; inf where the other surface is empty)."""
    thresholds = sorted({*ALSO_AT_M, threshold_m})
    return Scores(
        accuracy_m=_mean(pred_to_gt),
        completion_m=_mean(gt_to_pred),
        normal_consistency=normal_consistency,
        at=tuple(AtThreshold(t, _share_below(pred_to_gt, t), _share_below(gt_to_pred, t)) for t in thresholds),
    )


def nearest_vertices(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(N,) distance from each point to the nearest of the other points, metres; inf without others."""
    if not len(points) or not len(others):
        return np.full(len(points), np.inf)
    return cKDTree(others).query(points, workers=-1)[0]


def downsample(points: np.ndarray, voxel_m: float) -> np.ndarray:
    """(M, 3) means of the points in each occupied cell of a lattice that starts at the points' lower corner
    less half a voxel (open3d's `voxel_down_sample`, which the published protocols call)."""
    if not len(points):
        return np.zeros((0, 3))
    cells = np.floor((points - (points.min(axis=0) - voxel_m / 2)) / voxel_m).astype(np.int64)
    shape = cells.max(axis=0) + 1
    if np.prod(shape.astype(np.float64)) < LARGEST_LATTICE:
        _, inverse, counts = np.unique(np.ravel_multi_index(cells.T, shape), return_inverse=True, return_counts=True)
    else:  # few points far apart: their cells have no numbers, but an order
        _, inverse, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        inverse = inverse.reshape(-1)
    return np.stack([np.bincount(inverse, points[:, k]) for k in range(3)], axis=1) / counts[:, None]


def _mean(distances: np.ndarray) -> float | None:
    return float(distances.mean()) if len(distances) and np.isfinite(distances).all() else None


def _share_below(distances: np.ndarray, threshold_m: float) -> float:
    return float((distances < threshold_m).mean()) if len(distances) else 0.0
