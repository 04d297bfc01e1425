"""What each vertex of a finished mesh rests on, in mesh.ply beside its colour.

`source` is 0 where views have measured the surface and 1 where it was inferred from what is around it; `views` is how
many have seen the place, 255 at most; `expected_error` is one standard deviation along the normal, metres.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import KDTree

SOURCE, VIEWS, EXPECTED_ERROR = "source", "views", "expected_error"
NAMES = (SOURCE, VIEWS, EXPECTED_ERROR)
MEASURED, INFERRED = 0, 1


def with_source(mesh: trimesh.Trimesh, raw: np.ndarray, views: np.ndarray, least: float) -> trimesh.Trimesh:
    """The mesh with `SOURCE` and `VIEWS` as vertex attributes: those of the nearest raw vertex.

    Args:
        raw: (N, 3) metres, vertices before smoothing, from which the mesh was made.
        views: (N,) uint8.
        least: number of views that a measured vertex has.
    """
    near = KDTree(raw).query(np.asarray(mesh.vertices))[1]
    mesh.vertex_attributes[VIEWS] = views[near]
    mesh.vertex_attributes[SOURCE] = np.where(views[near] >= least, MEASURED, INFERRED).astype(np.uint8)
    return mesh


def told_by(mesh: trimesh.Trimesh, name: str) -> np.ndarray | None:
    """(V,) one of `NAMES` of a mesh's vertices; None: it does not say."""
    values = mesh.vertex_attributes.get(name)
    return None if values is None else np.asarray(values)


def with_nearest_error(mesh: trimesh.Trimesh, of: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with `EXPECTED_ERROR` of the nearest vertices of the one that it was made from, if that has it."""
    expected = told_by(of, EXPECTED_ERROR)
    if expected is not None and EXPECTED_ERROR not in mesh.vertex_attributes:
        near = KDTree(np.asarray(of.vertices)).query(np.asarray(mesh.vertices))[1]
        mesh.vertex_attributes[EXPECTED_ERROR] = expected[near]
    return mesh


def copied_source(mesh: trimesh.Trimesh, of: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with the attributes of one with the same vertices."""
    for name in NAMES:
        if name in of.vertex_attributes:
            mesh.vertex_attributes[name] = of.vertex_attributes[name]
    return mesh
