"""Mesh files: refused when unusable, never left half-written."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from room2dgs.captures.listing import MESH_SUFFIXES
from room2dgs.errors import InputError, first_line
from room2dgs.files import whole_file
from room2dgs.mesh.checks import FARTHEST
from room2dgs.mesh.glb_counts import check_glb
from room2dgs.mesh.ply_bytes import ply_bytes
from room2dgs.mesh.ply_mesh import read_ply_mesh
from room2dgs.regular_files import check_regular, open_regular
from room2dgs.texts import shown_name

MEND = "give the path of a triangle mesh (.ply)"


def write_mesh(path: Path, mesh: trimesh.Trimesh) -> None:
    """Write a binary PLY (colours with it), whole or not at all; far from the origin in double (`ply_bytes`).

    Raises:
        OSError: the disk refuses; an older file at `path` stays as it was.
    """
    with whole_file(Path(path)) as temporary:
        temporary.write_bytes(ply_bytes(mesh))


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Read a triangle mesh (PLY, OBJ, OFF, STL, GLB) as it stands: nothing merged, nothing reordered.

    Polygons become fans of triangles. Vertices that are NaN or infinite are left out where no face uses them. Other
    files (materials, textures, buffers) that it points to are not opened.

    Raises:
        InputError: missing, no regular file, not decodable, no faces, faces that name vertices which are not there or
            that use non-finite ones, or coordinates that no room has.
    """
    path = Path(path)
    check_regular(path, MEND)
    kind = path.suffix.lower()
    if kind not in MESH_SUFFIXES:
        raise InputError(
            f"{path} cannot be decoded as a mesh: its name ends in {path.suffix!r}; give one of "
            f"{', '.join(MESH_SUFFIXES)}"
        )
    try:
        if kind == ".ply":
            mesh = read_ply_mesh(path, MEND)
        else:
            mesh = _read_by_trimesh(path, kind)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except InputError:
        raise
    except Exception as error:  # trimesh's parsers raise whatever their file format met
        raise InputError(f"{path} cannot be decoded as a mesh ({first_line(error)}); write it again") from error
    if vertices.ndim != 2 or not len(vertices) or faces.ndim != 2 or not len(faces):
        raise InputError(f"{path} holds no triangles; give a triangle mesh, not a point cloud or an empty file")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path} has faces that name vertices which are not there; write it again")
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        bad = int((~finite[np.unique(faces)]).sum())
        if bad:
            raise InputError(f"{path} has {bad} vertices that are NaN or infinite; remove them")
        mesh.update_vertices(finite)
    farthest = float(np.abs(np.asarray(mesh.vertices)).max())
    if farthest > FARTHEST:
        raise InputError(f"{path} has coordinates up to {farthest:.0e}, which no room has; check how it was written")
    return mesh


def _read_by_trimesh(path: Path, kind: str) -> trimesh.Trimesh:
    with open_regular(path) as file:
        if kind == ".glb":
            check_glb(path, file)
        # a resolver would open what the file points to; materials are of no use here
        options = {"skip_materials": True} if kind in (".glb", ".obj") else {}
        content = BytesIO(file.read())  # what `open_regular` gives has a number for a name, which trimesh would use
        return trimesh.load_mesh(content, file_type=kind[1:], resolver=NoOthers(path), process=False, **options)


class NoOthers(Resolver):
    """What a mesh file points to is not opened."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def get(self, name: object) -> bytes:
        raise InputError(f"{self.path} points to another file ({shown_name(name)}); write the mesh into one file")

    def keys(self) -> tuple:
        return ()

    def write(self, name: object, data: object) -> None:
        self.get(name)

    def namespaced(self, namespace: object) -> NoOthers:
        return self
