"""Areas of a mesh's faces, a part at a time: corners and their products take several times the faces' memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from room2dgs.geometry.arguments import check_points
from room2dgs.mesh.checks import check_faces

PART = 200_000  # faces looked at together


def area_m2(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Of all faces; vertices in metres.

    Raises:
        TypeError, ValueError: no (V, 3) numbers, or faces that are no (F, 3) rows of their places.
    """
    return float(sum(np.linalg.norm(areas, axis=1).sum() for _, areas in twice_areas(vertices, faces))) / 2


def twice_areas(vertices: np.ndarray, faces: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Which faces, and (F, 3) their normals of twice their areas' length.

    Raises:
        TypeError, ValueError: as `area_m2`.
    """
    vertices = check_points("vertices", vertices)
    faces = check_faces(faces, len(vertices))
    for start in range(0, len(faces), PART):
        part = slice(start, start + PART)
        a, b, c = (vertices[faces[part, corner]] for corner in range(3))
        yield part, np.cross(b - a, c - a)
