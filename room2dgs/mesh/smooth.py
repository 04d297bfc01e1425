"""The roughness of voxels off a surface, its shape and its rims left.

Taubin 1995: a step moves each vertex half of the way to the mean of its neighbours, then a little more than that back,
so that what is as rough as the voxels goes and what is larger neither shrinks nor grows.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import csr_matrix

from room2dgs.geometry.arguments import whole_number
from room2dgs.mesh.checks import check_mesh
from room2dgs.mesh.edges import edges_and_faces
from room2dgs.mesh.vertex_colors import vertex_colors

SHRINK, GROW = 0.5, 0.53


def smoothed(mesh: trimesh.Trimesh, steps: int) -> trimesh.Trimesh:
    """A mesh with the same faces and colours; the same bits on any number of threads.

    Vertices stay to the last bit where a surface ends or several meet: on edges that are not of exactly two faces.

    Args:
        mesh: with vertices at the same place made one (`clean`), or each face is a surface of its own.
        steps: 0 or more.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be; no such number.
    """
    check_mesh(mesh)
    whole_number("steps", steps)
    vertices = np.array(mesh.vertices, dtype=np.float64)
    edges, faces = edges_and_faces(np.asarray(mesh.faces), len(vertices))
    pinned = np.zeros(len(vertices), dtype=bool)
    pinned[edges[faces != 2]] = True
    free, count = (~pinned)[:, None], np.bincount(edges.ravel(), minlength=len(vertices))[:, None]
    later = _later_neighbours(edges, len(vertices))
    for _ in range(steps):
        for share in (SHRINK, -GROW):
            mean = (later @ vertices + later.T @ vertices) / np.maximum(count, 1)
            vertices += np.where(free, share * (mean - vertices), 0.0)
    return trimesh.Trimesh(vertices, np.array(mesh.faces), vertex_colors=vertex_colors(mesh), process=False)


def _later_neighbours(edges: np.ndarray, vertices: int) -> csr_matrix:
    """(V, V) of ones at a vertex's neighbours of higher number: with its transpose, all of them, in half the memory.

    Args:
        edges: (E, 2) rising, smaller vertex first.
    """
    firsts = np.searchsorted(edges[:, 0], np.arange(vertices + 1)).astype(np.int32)
    return csr_matrix((np.ones(len(edges)), edges[:, 1].copy(), firsts), shape=(vertices, vertices))
