"""The files of a run's mesh, cut to a box: faces with all corners inside stay."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import trimesh

from room2dgs.captures.world_offset import Origin
from room2dgs.errors import InputError
from room2dgs.export.mesh_files import dull_material, gltf_bytes
from room2dgs.export.texture.write import kept_jpeg
from room2dgs.mesh.io import read_mesh
from room2dgs.mesh.ply_bytes import ply_bytes
from room2dgs.runs.page.room import glb_box

Box = tuple[np.ndarray, np.ndarray]  # (3,) corners, metres, scene's frame


def cropped_ply(path: Path, box: Box, origin_m: Origin) -> bytes:
    """mesh.ply with what its vertices know, in the capture's world as it was.

    Raises:
        InputError: the file cannot be read.
    """
    mesh = read_mesh(path)
    return ply_bytes(_cut(mesh, np.asarray(mesh.vertices) - np.array(origin_m), box))


def cropped_glb(path: Path, box: Box, y_up: np.ndarray, offset_m: np.ndarray) -> bytes:
    """A textured GLB with its picture as it was.

    Args:
        y_up: (3, 3) rotation from the scene to the file's frame; offset_m: (3,) translation of the mesh there.

    Raises:
        OSError: the file cannot be read.
        InputError: it has no mesh with a picture.
    """
    data = path.read_bytes()
    if glb_box(data) is None:
        raise InputError(f"{path} is not a mesh with a picture; make it anew with `room2dgs mesh`")
    (mesh,) = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False).geometry.values()
    uv, image = mesh.visual.uv, mesh.visual.material.baseColorTexture
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.vertex_normals, process=False)
    whole.visual = trimesh.visual.TextureVisuals(uv=uv, material=dull_material(kept_jpeg(image)))
    return gltf_bytes(_cut(whole, np.asarray(mesh.vertices) @ y_up, box), offset_m)


def _cut(mesh: trimesh.Trimesh, places: np.ndarray, box: Box) -> trimesh.Trimesh:
    """Places (V, 3) are those of the vertices in the box's frame."""
    inside: np.ndarray = np.all((places >= box[0]) & (places <= box[1]), axis=1)
    mesh.update_faces(inside[mesh.faces].all(axis=1))
    mesh.remove_unreferenced_vertices()
    return mesh
