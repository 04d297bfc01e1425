"""Geometric consistency: which neighbours' depth leads from a pixel to the same point and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs import _C
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.patchmatch import warp


class GeometricConsistency(NamedTuple):
    """What the neighbours' depth says of a view's pixels.

    Attributes:
        inverse_depth: (H, W) float32, 1/m, mean of the view's own and of the consistent neighbours'.
        num_consistent: (H, W) uint8 neighbours that have the same surface there.
        num_seen_through: (H, W) uint8 neighbours that look through the point at something behind it.
        num_hidden: (H, W) uint8 neighbours from which something nearer hides the point.
        sigma: (H, W) float32, relative standard deviation of what was averaged; 0 with fewer than two.
    """

    inverse_depth: np.ndarray
    num_consistent: np.ndarray
    num_seen_through: np.ndarray
    num_hidden: np.ndarray
    sigma: np.ndarray


def geometric_consistency(
    camera: Camera,
    inverse_depth: np.ndarray,
    others: Sequence[tuple[Camera, np.ndarray]],
    max_px: float,
    max_relative: float,
) -> GeometricConsistency:
    """Compare a view's depth with its neighbours'.

    A neighbour is consistent where its depth at the projection leads the point back to within `max_px` of where it came
    from and differs by less than `max_relative`. Between four pixels of one surface its inverse depth is interpolated,
    which is exact on planes; elsewhere it is that of the nearest pixel.

    Args:
        inverse_depth: (H, W) float32, 1/m, 0 = unknown.
        others: camera and inverse depth of each neighbour.
    """
    w = np.ascontiguousarray(inverse_depth, np.float32)
    consistent, through, hidden = (np.zeros(w.shape, np.uint8) for _ in range(3))
    total, squares = w.copy(), w * w
    for other, theirs in others:
        warps = warp(camera, other), warp(other, camera)
        seen = np.ascontiguousarray(theirs, np.float32)
        _C.agree(w, seen, *warps, max_px, max_relative, consistent, through, hidden, total, squares)
    mean = total / (consistent + 1)
    variance = np.maximum(squares / (consistent + 1) - mean * mean, 0)
    sigma = np.divide(np.sqrt(variance), mean, out=np.zeros_like(mean), where=mean > 0)
    return GeometricConsistency(mean, consistent, through, hidden, sigma)
