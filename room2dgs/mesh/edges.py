"""A mesh's edges, in little memory: trimesh keeps tables of them that a room's mesh has no memory for."""

from __future__ import annotations

import numpy as np

from room2dgs.geometry.arguments import whole_number
from room2dgs.mesh.checks import check_faces


def edges_and_faces(faces: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) int32 edges, each once, smaller vertex first; (E,) how many faces each is of.

    Args:
        faces: (F, 3).
        vertices: how many there are.

    Raises:
        TypeError, ValueError: faces that name vertices which are not there, or no such numbers.
    """
    vertices = whole_number("vertices", vertices)
    faces = check_faces(faces, vertices)
    of_sides = np.empty((3, len(faces)), dtype=np.int64)
    for side in range(3):
        a, b = faces[:, side], faces[:, (side + 1) % 3]
        of_sides[side] = np.minimum(a, b) * vertices + np.maximum(a, b)
    keys = of_sides.ravel()
    keys.sort()  # in place, which numpy's unique does not
    first = np.flatnonzero(np.diff(keys, prepend=-1))
    count = np.diff(first, append=len(keys)).astype(np.int32)
    keys, edges = keys[first], np.empty((len(first), 2), dtype=np.int32)
    edges[:, 0], edges[:, 1] = keys // vertices, keys % vertices
    return edges, count


def is_closed(faces: np.ndarray, vertices: int) -> bool:
    """Whether there are faces, and each edge is of two."""
    edges, count = edges_and_faces(faces, vertices)
    return len(edges) > 0 and bool((count == 2).all())
