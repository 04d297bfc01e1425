"""The oracle of `geometric_consistency` in numpy, float64."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.captures.depth_at import inverse_depth_at
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.geometric_consistency import GeometricConsistency
from room2dgs.stereo.patchmatch import warp


def geometric_consistency_reference(
    camera: Camera,
    inverse_depth: np.ndarray,
    others: Sequence[tuple[Camera, np.ndarray]],
    max_px: float,
    max_relative: float,
) -> GeometricConsistency:
    """As `geometric_consistency`."""
    height, width = inverse_depth.shape
    y, x = np.mgrid[:height, :width].astype(np.float64)
    w = inverse_depth.astype(np.float64)
    count, through, hidden = (np.zeros((height, width), np.uint8) for _ in range(3))
    total, squares = w.copy(), w * w
    for other, theirs in others:
        u, v, z = _carried(warp(camera, other), x, y, w)
        inside = (w > 0) & (z > 1e-6) & (u > -0.5) & (u < other.width - 0.5) & (v > -0.5) & (v < other.height - 0.5)
        seen = inverse_depth_at(theirs.astype(np.float64), np.where(inside, u, 0), np.where(inside, v, 0))
        inside &= seen > 0
        back_x, back_y, back_z = _carried(warp(other, camera), u, v, seen)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.hypot(back_x - x, back_y - y)
            ratio = w / z / seen  # of the depth that the neighbour has there to the point's
            agrees = inside & (back_z > 1e-6) & (off < max_px) & (np.abs(ratio - 1) < max_relative)
            said = np.where(agrees, seen / back_z, 0)
        count += agrees
        through += inside & (ratio > 1 + max_relative)
        hidden += inside & (ratio < 1 - max_relative)
        total += said
        squares += said * said
    mean = total / (count + 1)
    variance = np.maximum(squares / (count + 1) - mean * mean, 0)
    spread = np.divide(np.sqrt(variance), mean, out=np.zeros_like(mean), where=mean > 0)
    return GeometricConsistency(mean, count, through, hidden, spread)


def _carried(
    matrix: np.ndarray, x: np.ndarray, y: np.ndarray, w: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixel in the other view, and z relative to the first view's."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # pixels beside the other camera's plane
        p, q, z = (row[0] * x + row[1] * y + row[2] + row[3] * w for row in matrix)
        return p / z, q / z, z
