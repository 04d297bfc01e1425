"""What each vertex of a finished mesh rests on, in mesh.ply beside its colour.

`source` is 0 where views have measured the surface and 1 where it was inferred from what is around it; `views` is how
many have seen the place, 255 at most.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import KDTree

SOURCE, VIEWS = "source", "views"
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


def copied_source(mesh: trimesh.Trimesh, of: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with the attributes of one with the same vertices."""
    for name in (SOURCE, VIEWS):
        if name in of.vertex_attributes:
            mesh.vertex_attributes[name] = of.vertex_attributes[name]
    return mesh
