"""The roughness of voxels off a surface, its shape and its rims left.

Taubin 1995: a step moves each vertex half of the way to the mean of its neighbours, then a little more than that back,
so that what is as rough as the voxels goes and what is larger neither shrinks nor grows. trimesh has it, too, but keeps
tables of a mesh's edges that a room's mesh has no memory for.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import csr_matrix

SHRINK, GROW = 0.5, 0.53


def smoothed(mesh: trimesh.Trimesh, steps: int) -> trimesh.Trimesh:
    """A mesh with the same faces and colours; the same bits on any number of threads.

    Vertices stay to the last bit where a surface ends or several meet: on edges that are not of exactly two faces.

    Args:
        mesh: with vertices at the same place made one (`clean`), or each face is a surface of its own.
    """
    vertices = np.array(mesh.vertices, dtype=np.float64)
    edges, pinned = _edges_and_rims(np.asarray(mesh.faces), len(vertices))
    mean = _mean_of_neighbours(edges, len(vertices))
    free = (~pinned)[:, None]
    for _ in range(steps):
        for share in (SHRINK, -GROW):
            vertices += np.where(free, share * (mean @ vertices - vertices), 0.0)
    colors = np.asarray(mesh.visual.vertex_colors) if mesh.visual.kind == "vertex" else None
    return trimesh.Trimesh(vertices, np.array(mesh.faces), vertex_colors=colors, process=False)


def _edges_and_rims(faces: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) int32 edges, each once; (V,) bool: on an edge that is not of exactly two faces."""
    keys = np.empty((3, len(faces)), dtype=np.int64)
    for side in range(3):
        a, b = faces[:, side], faces[:, (side + 1) % 3]
        keys[side] = np.minimum(a, b) * vertices + np.maximum(a, b)
    keys, count = np.unique(keys, return_counts=True)
    edges = np.stack(np.divmod(keys, vertices), axis=1).astype(np.int32)
    pinned = np.zeros(vertices, dtype=bool)
    pinned[edges[count != 2]] = True
    return edges, pinned


def _mean_of_neighbours(edges: np.ndarray, vertices: int) -> csr_matrix:
    """(V, V): each row sums to 1; of a vertex without neighbours, to 0."""
    count = np.bincount(edges.ravel(), minlength=vertices)
    ends = np.concatenate([edges, edges[:, ::-1]])
    return csr_matrix((1.0 / count[ends[:, 0]], (ends[:, 0], ends[:, 1])), shape=(vertices, vertices))
