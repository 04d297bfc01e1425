"""The open boundary of a mesh: its edges of one face, in loops, and the pieces that the mesh is in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

LONGEST_M = 0.04  # longer edges are cut into parts that are judged by themselves


@dataclass(frozen=True)
class Boundary:
    """Parts of the open boundary, E of them, none longer than `LONGEST_M`.

    Attributes:
        ends: (E, 2, 3) metres.
        outward: (E, 3) unit, in the plane of the edge's face, away from it.
        loop: (E,) int64, the closed line that each is part of: 0, 1, ...
    """

    ends: np.ndarray
    outward: np.ndarray
    loop: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """(E,) metres."""
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)

    @property
    def middle(self) -> np.ndarray:
        """(E, 3) metres."""
        return self.ends.mean(axis=1)


@dataclass(frozen=True)
class Sides:
    """The sides of all faces, 3 F of them, those of one edge one after the other.

    Attributes:
        of: (3 F,) int64 side 3 f + k runs from corner k of face f to the next one.
        same: (3 F - 1,) bool: whether a side has the same edge as the one after it.
        vertices: (3 F, 2) smaller vertex first.
        corners: (3 F, 2) int64 the corners 3 f + k at these vertices.
    """

    of: np.ndarray
    same: np.ndarray
    vertices: np.ndarray
    corners: np.ndarray

    @property
    def alone(self) -> np.ndarray:
        """(3 F,) bool: the edge's only side."""
        alone = np.ones(len(self.of), bool)
        alone[:-1] &= ~self.same
        alone[1:] &= ~self.same
        return alone


def sides(faces: np.ndarray) -> Sides:
    """Sides in the order of their edges.

    Args:
        faces: (F, 3) int64; vertices at one place are one.
    """
    corner = np.arange(3 * len(faces)).reshape(-1, 3)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    corners = np.stack([corner.ravel(), np.roll(corner, -1, axis=1).ravel()], axis=1)
    swapped = start > end
    corners[swapped] = corners[swapped, ::-1]
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((high, low))
    vertices = np.stack([low, high], axis=1)[order]
    return Sides(order, (vertices[1:] == vertices[:-1]).all(axis=1), vertices, corners[order])


def open_boundary(vertices: np.ndarray, faces: np.ndarray, edges: Sides | None = None) -> Boundary:
    """The boundary of a mesh. Holes that touch in a vertex are one loop, pieces that do so have a loop each.

    Args:
        vertices: (V, 3) metres.
        faces, edges: as `sides`.
    """
    edges = sides(faces) if edges is None else edges
    alone = edges.alone
    side, corners = edges.of[alone], edges.corners[alone]
    loop = _loops(faces, edges, corners)
    face, first = np.divmod(side, 3)
    start, end, third = (vertices[faces[face, (first + step) % 3]] for step in range(3))
    along = end - start
    length = np.linalg.norm(along, axis=1)
    along /= np.maximum(length, 1e-12)[:, None]
    outward = start - third
    outward = outward - np.einsum("nc,nc->n", outward, along)[:, None] * along
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    parts = np.maximum(1, np.ceil(length / LONGEST_M)).astype(np.int64)
    which = np.repeat(np.arange(len(parts)), parts)
    place = np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)
    step = (end - start)[which] / parts[which, None]
    begin = start[which] + place[:, None] * step
    return Boundary(np.stack([begin, begin + step], axis=1), outward[which], loop[which])


def pieces(faces: np.ndarray, edges: Sides | None = None) -> np.ndarray:
    """(F,) int64 the piece of each face: faces that share an edge are of one."""
    edges = sides(faces) if edges is None else edges
    face = edges.of // 3
    return _components(np.stack([face[:-1], face[1:]], axis=1)[edges.same], len(faces))


def _loops(faces: np.ndarray, edges: Sides, corners: np.ndarray) -> np.ndarray:
    """(B,) the loop of each side of the boundary.

    Faces around a vertex that hang together by edges share one copy of it. Each copy then has two boundary edges.

    Args:
        corners: (B, 2) of the boundary's sides.
    """
    on_rim = np.zeros(faces.max(initial=-1) + 1, bool)
    on_rim[faces.ravel()[corners.ravel()]] = True
    links = [
        np.stack([edges.corners[:-1, k], edges.corners[1:, k]], axis=1)[edges.same & on_rim[edges.vertices[1:, k]]]
        for k in range(2)
    ]
    copy = _components(np.concatenate(links), faces.size)
    ends = copy[corners]
    label = _components(ends, int(copy.max(initial=-1)) + 1)
    return np.unique(label[ends[:, 0]], return_inverse=True)[1]


def _components(links: np.ndarray, count: int) -> np.ndarray:
    graph = coo_matrix((np.ones(len(links), bool), (links[:, 0], links[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)
