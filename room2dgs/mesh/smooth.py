"""The roughness of voxels off a surface, its shape and its rims left.

Taubin 1995, as trimesh has it: a step moves each vertex half of the way to the mean of its neighbours, then a little
more than that back, so that what is as rough as the voxels goes and what is larger neither shrinks nor grows.
"""

from __future__ import annotations

import numpy as np
import trimesh
from trimesh.smoothing import filter_taubin, laplacian_calculation

SHRINK, GROW = 0.5, 0.53


def smoothed(mesh: trimesh.Trimesh, steps: int) -> trimesh.Trimesh:
    """A mesh with the same faces and colours; the same bits on any number of threads.

    Vertices stay to the last bit where a surface ends or several meet: on edges that are not of exactly two faces.

    Args:
        mesh: with vertices at the same place made one (`clean`), or each face is a surface of its own.
    """
    found = mesh.copy()
    pinned = np.unique(_rims(mesh))
    neighbours = laplacian_calculation(found, pinned_vertices=pinned).tocsr()
    return filter_taubin(found, SHRINK, GROW, 2 * steps, neighbours)


def _rims(mesh: trimesh.Trimesh) -> np.ndarray:
    """(E, 2) edges that are not of exactly two faces."""
    a, b = mesh.edges_sorted.T
    edges, count = np.unique(a * len(mesh.vertices) + b, return_counts=True)
    return np.stack(np.divmod(edges[count != 2], len(mesh.vertices)), axis=1)
