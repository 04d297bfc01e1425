"""Triangle meshes of PLY files: as they stand, polygons as fans of triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from room2dgs.captures.ply_elements import Lists, read_elements
from room2dgs.errors import InputError
from room2dgs.mesh.vertex_source import NAMES

INDICES = ("vertex_indices", "vertex_index")
COLOUR = ("red", "green", "blue", "alpha")


def read_ply_mesh(path: Path, mend: str) -> trimesh.Trimesh:
    """With colours of vertices, else of faces, and what vertices rest on (`vertex_source`). Normals and textures are
    left out. Faces are not checked.

    Raises:
        InputError: as `read_elements`; there are no vertices with x, y and z.
    """
    elements = read_elements(path, ("vertex", "face"), mend)
    vertex = elements["vertex"].single if "vertex" in elements else {}
    if not all(axis in vertex for axis in "xyz"):
        raise InputError(f"{path} cannot be decoded as a mesh (no vertices with x, y and z); write it again")
    faces, of_face = np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    face = elements.get("face")
    indices = next((face.lists[name] for name in INDICES if name in face.lists), None) if face else None
    if indices is not None:
        faces, of_face = triangles(indices)
    colors = _together(vertex, COLOUR, 3)
    face_colors = _together(face.single, COLOUR, 3) if face and colors is None else None
    mesh = trimesh.Trimesh(
        vertices=_together(vertex, tuple("xyz"), 3),
        faces=faces,
        vertex_colors=colors,
        face_colors=None if face_colors is None else face_colors[of_face],
        process=False,
    )
    for name in NAMES:
        if name in vertex:
            mesh.vertex_attributes[name] = vertex[name]
    return mesh


def triangles(polygons: Lists) -> tuple[np.ndarray, np.ndarray]:
    """(F, 3) int64 corners, in the polygons' order, and (F,) of which polygon; those of fewer than three corners have
    none."""
    lengths, values = polygons
    if len(lengths) and (lengths == 3).all():
        return values.reshape(-1, 3).astype(np.int64), np.arange(len(lengths))
    many = np.maximum(lengths - 2, 0)
    polygon = np.repeat(np.arange(len(lengths)), many)
    first = np.cumsum(lengths) - lengths
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(many) - many, many)
    start = first[polygon]
    corners = np.stack([start, start + step + 1, start + step + 2], axis=1)
    return values[corners].astype(np.int64) if len(corners) else np.zeros((0, 3), np.int64), polygon


def _together(columns: dict[str, np.ndarray], names: tuple[str, ...], least: int) -> np.ndarray | None:
    """(N, 3) or (N, 4) of those that are there."""
    found = [columns[name] for name in names if name in columns]
    return np.column_stack(found) if len(found) >= least else None
