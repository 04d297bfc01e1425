"""Mesh files: refused when unusable, never left half-written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from room2dgs.errors import InputError, first_line
from room2dgs.files import whole_file
from room2dgs.mesh.ply_bytes import ply_bytes


def write_mesh(path: Path, mesh: trimesh.Trimesh) -> None:
    """Write a binary PLY (colours with it), whole or not at all; far from the origin in double (`ply_bytes`).

    Raises:
        OSError: the disk refuses; an older file at `path` stays as it was.
    """
    with whole_file(Path(path)) as temporary:
        temporary.write_bytes(ply_bytes(mesh))


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Read a triangle mesh (PLY, OBJ, OFF, STL, GLB) as it stands: nothing merged, nothing reordered.

    Raises:
        InputError: missing, not decodable, no faces, faces that name vertices which are not there, or
            non-finite vertices.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} is missing; give the path of a triangle mesh (.ply)")
    try:
        mesh = trimesh.load(path, process=False, force="mesh")
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # trimesh's parsers raise whatever their file format met
        raise InputError(f"{path} cannot be decoded as a mesh ({first_line(error)}); write it again") from error
    if vertices.ndim != 2 or not len(vertices) or faces.ndim != 2 or not len(faces):
        raise InputError(f"{path} holds no triangles; give a triangle mesh, not a point cloud or an empty file")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path} has faces that name vertices which are not there; write it again")
    bad = int((~np.isfinite(vertices).all(axis=1)).sum())
    if bad:
        raise InputError(f"{path} has {bad} vertices that are NaN or infinite; remove them")
    return mesh
