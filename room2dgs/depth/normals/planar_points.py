"""Normals of the sparse points themselves, where they lie on a plane: few and rough, but measured."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from room2dgs.geometry.cells import cells_of

NEIGHBOURS = 16
# The normals of nearer neighbours are the points' noise rather than the surface's.
SPACING_M = 0.05
# Of a plane: its variance across against that along its shorter side, and that against the longer side.
MAX_THICKNESS, MIN_WIDTH = 0.05, 0.1


def planar_normals(xyz: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Normals by principal components of some points' neighbours.

    Args:
        xyz: (M, 3) metres.
        indices: (N,) of the points.

    Returns:
        (N, 3) float64 unit, of either sign; 0 where the neighbours lie on no plane.
    """
    thinned = xyz[cells_of(xyz, SPACING_M)[0]]
    normals = np.zeros((len(indices), 3))
    if len(thinned) < NEIGHBOURS:
        return normals
    near = thinned[cKDTree(thinned).query(xyz[indices], k=NEIGHBOURS)[1]]
    offsets = near - near.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", offsets, offsets))
    plane = (variances[:, 0] < MAX_THICKNESS * variances[:, 1]) & (variances[:, 1] > MIN_WIDTH * variances[:, 2])
    normals[plane] = axes[plane, :, 0]
    return normals
