"""Gaps of a surface: what lies between measured parts stays where the gap is narrow, the rest is cut away."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from room2dgs.mesh.edges import edges_and_faces


def narrow_gaps(vertices: np.ndarray, faces: np.ndarray, seen: np.ndarray, gap_m: float) -> np.ndarray:
    """(V,) bool: vertices that stay, all seen ones and the others in gaps narrower than `gap_m`.

    That is the closing of the seen ones along the surface: grown by half of the gap, then shrunk by as much.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3).
        seen: (V,) bool.
        gap_m: metres.
    """
    if seen.all() or not seen.any() or not gap_m > 0:
        return seen
    edges, count = edges_and_faces(faces, len(vertices))
    rim = edges[count == 1]
    edges = edges[~seen[edges].all(axis=1)]  # the seen ones need no way
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    half = gap_m / 2
    grown = _within(edges, length, seen, half, len(vertices))
    outside = ~grown
    outside[rim] |= ~seen[rim]
    return seen | (grown & ~_within(edges, length, outside, half, len(vertices)))


def _within(edges: np.ndarray, length: np.ndarray, sources: np.ndarray, reach_m: float, count: int) -> np.ndarray:
    """(V,) bool: at most so far from a source along edges, which are a little longer than the surface's own ways."""
    if not sources.any():
        return sources
    graph = coo_matrix((np.maximum(length, 1e-9), (edges[:, 0], edges[:, 1])), shape=(count, count)).tocsr()
    away = dijkstra(graph, directed=False, indices=np.flatnonzero(sources), min_only=True, limit=reach_m)
    return np.isfinite(away)
