"""What public functions on meshes are given: libraries beneath them read past the end of what they get."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from room2dgs.geometry.arguments import check_points

FARTHEST = 1e12  # of a coordinate, in whatever unit: beyond it areas overflow


def check_mesh(mesh: Any, finite: bool = True) -> None:
    """A mesh whose faces name vertices that are there; it may have no faces.

    Args:
        finite: all vertices must be, and within 10^12.

    Raises:
        TypeError: it is no `trimesh.Trimesh`.
        ValueError: faces or vertices that cannot be.
    """
    if not isinstance(mesh, trimesh.Trimesh):
        raise TypeError(f"a mesh is to be a trimesh.Trimesh, not of the type {type(mesh).__name__}")
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    check_faces(faces.reshape(-1, 3) if not faces.size else faces, len(vertices))
    if not finite or not vertices.size:
        return
    check_points("vertices", vertices)
    # a NaN fails the comparison
    if not (vertices.min() >= -FARTHEST and vertices.max() <= FARTHEST):
        raise ValueError("the mesh has vertices that are NaN, infinite or farther off than 10^12; drop them first")


def check_surface(mesh: Any) -> None:
    """The same, with faces.

    Raises:
        TypeError, ValueError: as `check_mesh`; there are no faces.
    """
    check_mesh(mesh)
    if not len(mesh.faces):
        raise ValueError("the mesh has no faces")


def check_faces(faces: Any, vertices: int) -> np.ndarray:
    """(F, 3) int64, rows of numbers of vertices.

    Args:
        vertices: how many there are.

    Raises:
        TypeError: they are no whole numbers.
        ValueError: another shape; a vertex that is not there.
    """
    found = np.asarray(faces)
    if found.dtype.kind not in "iu":
        raise TypeError(f"faces are of {found.dtype}, not whole numbers")
    if found.ndim != 2 or found.shape[1] != 3:
        raise ValueError(f"faces have shape {found.shape}, not (F, 3)")
    if found.size and not (found.min() >= 0 and found.max() < vertices):
        raise ValueError(
            f"faces name vertices from {found.min()} to {found.max()}, but there are {vertices}, counted from 0"
        )
    return found.astype(np.int64, copy=False)
