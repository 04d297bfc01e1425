"""Sharpness: the error of a mesh beside the creases of the truth."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from room2dgs.eval.boundary import Sides, sides
from room2dgs.eval.surface import Surface

CREASE_DEG = 40.0  # faces that meet at a larger turn are a crease
SAME_DEG = 15.0  # normals of one side of a crease differ by less
NEAR_M, FAR_M = 0.015, 0.035  # beside a crease each side is asked for its normal at these distances
BESIDE_M = 0.03
STEP_M = 0.01  # between points of a crease
FOUND_M = 0.05  # a surface farther off is missing, not blunt


def crease_points(vertices: np.ndarray, faces: np.ndarray, truth: Surface) -> np.ndarray:
    """(N, 3) points along the creases of a truth, both of whose sides are even.

    Args:
        vertices, faces: of the truth; vertices at one place are one.
        truth: the same surface.
    """
    edges = sides(faces)
    pair = np.flatnonzero(edges.same)
    face = np.stack([edges.of[pair], edges.of[pair + 1]], axis=1) // 3
    normal = truth.face_normals[face]
    facing = np.where(_runs_alike(faces, edges, pair), -1.0, 1.0)
    turn = np.einsum("nc,nc->n", normal[:, 0], normal[:, 1]) * facing
    sharp = turn < np.cos(np.radians(CREASE_DEG))
    ends, face = vertices[edges.vertices[pair[sharp]]], face[sharp]
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    parts = np.maximum(1, np.ceil(length / STEP_M)).astype(np.int64)
    which = np.repeat(np.arange(len(parts)), parts)
    place = (np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[which]
    points = ends[which, 0] + place[:, None] * along[which]
    even = np.ones(len(points), bool)
    for side in range(2):
        third = vertices[faces[face[:, side]]].mean(axis=1) - ends[:, 0]
        unit = along / np.maximum(length, 1e-12)[:, None]
        into = third - np.einsum("nc,nc->n", third, unit)[:, None] * unit
        into = (into / np.maximum(np.linalg.norm(into, axis=1, keepdims=True), 1e-12))[which]
        near, far = (truth.face_normals[truth.closest(points + at * into)[1]] for at in (NEAR_M, FAR_M))
        own = truth.face_normals[face[which, side]]
        same = np.cos(np.radians(SAME_DEG))
        for normals in (near, far):
            even &= np.abs(np.einsum("nc,nc->n", own, normals)) > same
    return points[even]


def crease_error(creases: np.ndarray, truth_points: np.ndarray, mesh: Surface) -> dict[str, float | None]:
    """ "crease_error_m": mean distance, metres, from the truth's points beside creases to the mesh, of those that are
    within `FOUND_M` of it; "crease_missing": share of the others. None without creases.

    Args:
        creases: (N, 3) as `crease_points`.
        truth_points: (M, 3) spread over the truth where it was seen.
    """
    error, missing = None, None
    if len(creases) and len(truth_points):
        beside = cKDTree(creases).query(truth_points, distance_upper_bound=BESIDE_M)[0] <= BESIDE_M
        distance = mesh.closest(truth_points[beside])[0]
        found = distance <= FOUND_M
        missing = float(1 - found.mean()) if len(found) else None
        error = float(distance[found].mean()) if found.any() else None
    return {"crease_error_m": error, "crease_missing": missing}


def _runs_alike(faces: np.ndarray, edges: Sides, pair: np.ndarray) -> np.ndarray:
    """(P,) bool: both faces of an edge run along it the same way: one winds the other way round."""
    start = faces.ravel()[edges.of]
    return np.asarray(start[pair] == start[pair + 1])
