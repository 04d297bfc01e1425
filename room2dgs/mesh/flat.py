"""Walls, floors and table tops lie on their planes: what differs by the noise of depth goes, what has relief stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from room2dgs.geometry.cells import KEY_BASE, cell_indices, keys_of
from room2dgs.mesh.vertex_colors import vertex_colors

CELL_M = 0.1
TURN = np.cos(np.radians(8.0))  # between neighbouring cells of one plane
STEP_M = 0.015  # from a cell's plane to its neighbour's middle
LEAST_M2 = 0.25  # of a plane
FLAT = 0.8  # of a plane's vertices lie within `NOISE_M` and face its way
FACING = np.cos(np.radians(30.0))
NOISE_M = 0.008  # as far as this a vertex goes all the way to its plane; from twice as far it stays
FORWARD = np.array([(x * KEY_BASE + y) * KEY_BASE + z for x in (0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
FORWARD = FORWARD[FORWARD > 0]  # a neighbour of each pair of opposite ones


@dataclass(frozen=True)
class _Cells:
    """Pieces of a surface in cells of space.

    Attributes:
        keys: (C,) int64, rising.
        of: (V,) the cell of each vertex.
        area: (C,) m2.
        middle, normal: (C, 3) metres, and unit.
    """

    keys: np.ndarray
    of: np.ndarray
    area: np.ndarray
    middle: np.ndarray
    normal: np.ndarray


def flattened(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with the vertices of its flat parts on their planes; faces and colours as they were.

    Cells of `CELL_M` that lie in one plane with their neighbours are a part. Its plane is fitted to all of it.

    Args:
        mesh: metres; vertices at one place are one.
    """
    vertices = np.array(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces)
    normals, areas = _vertex_normals(vertices, faces)
    cells = _cells(vertices, normals, areas)
    part = _parts(cells)[cells.of]
    for number in np.unique(part[part >= 0]):
        among = np.flatnonzero(part == number)
        _flatten(vertices, among, normals[among], areas[among])
    return trimesh.Trimesh(vertices, faces.copy(), vertex_colors=vertex_colors(mesh), process=False)


def _flatten(vertices: np.ndarray, among: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> None:
    place = vertices[among]
    middle, normal = _plane(place, areas)
    for _ in range(2):  # again without what stands out
        off = (place - middle) @ normal
        near = np.abs(off) < 2 * NOISE_M
        if areas[near].sum() < LEAST_M2:
            return
        middle, normal = _plane(place[near], areas[near])
    off = (place - middle) @ normal
    facing = np.abs(normals @ normal) > FACING
    if areas[(np.abs(off) < NOISE_M) & facing].sum() < FLAT * areas.sum():
        return
    stays = np.clip(np.abs(off) / NOISE_M - 1, 0, 1)  # 0 on the plane, 1 unchanged
    moved = np.where(facing, (stays - 1) * off, 0.0)
    # to a micrometre: vertices are sorted, and rounding must not decide which of a column comes first
    vertices[among] = np.round(vertices[among] + moved[:, None] * normal, 6)


def _plane(points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A point and the unit normal of the best plane."""
    share = weights / weights.sum()
    middle = share @ points
    apart = points - middle
    return middle, np.linalg.eigh((apart * share[:, None]).T @ apart)[1][:, 0]


def _vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) unit, 0 without faces, and (V,) a third of the area of the faces around each, m2."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    count = len(vertices)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(axis, 3), count) for axis in cross.T], axis=1)
    areas = np.bincount(faces.ravel(), np.repeat(np.linalg.norm(cross, axis=1), 3), count) / 6
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-20), areas


def _cells(vertices: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> _Cells:
    keys, of = np.unique(keys_of(cell_indices(vertices, CELL_M)), return_inverse=True)
    area = np.bincount(of, areas, len(keys))

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(of, areas * axis, len(keys)) for axis in values.T], axis=1) / np.maximum(
            area[:, None], 1e-20
        )

    normal = mean(normals)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 0.9, normal / np.maximum(length, 1e-20), 0.0)  # a cell with an edge has none
    return _Cells(keys, of, area, mean(vertices), normal)


def _parts(cells: _Cells) -> np.ndarray:
    """(C,) the flat part of each cell, -1 without one."""
    wanted = cells.keys[:, None] + FORWARD
    other = np.searchsorted(cells.keys, wanted).clip(max=len(cells.keys) - 1)
    one, which = np.nonzero(cells.keys[other] == wanted)
    other = other[one, which]
    apart = cells.middle[other] - cells.middle[one]
    joined = np.einsum("nc,nc->n", cells.normal[one], cells.normal[other]) > TURN
    for side in (one, other):
        joined &= np.abs(np.einsum("nc,nc->n", apart, cells.normal[side])) < STEP_M
    count = len(cells.keys)
    graph = coo_matrix((np.ones(joined.sum(), bool), (one[joined], other[joined])), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    large = np.bincount(label, cells.area) >= LEAST_M2
    return np.where(large[label] & (cells.normal != 0).any(axis=1), label, -1)
