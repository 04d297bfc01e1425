"""Meshes for other programs: GLB, OBJ and PLY, with normals and colours as each of them has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from room2dgs import __version__
from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.export.local_files import write_file
from room2dgs.export.source import Source
from room2dgs.export.text_rows import text_rows
from room2dgs.mesh.ply_bytes import ply_bytes
from room2dgs.mesh.vertex_colors import vertex_colors
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, told_by

NO_OFFSET = np.zeros(3)
ARRAY, ELEMENTS = 34962, 34963  # what a glTF buffer holds
SRGB_KNEE = 0.04045
UNLIT = "KHR_materials_unlit"
COLOR = "_COLOR"  # trimesh's name of an attribute that it does not know; glTF's is COLOR_0
ERROR = "_EXPECTED_ERROR"  # metres, one standard deviation along the normal


def write_glb(source: Source, path: Path) -> list[Path]:
    """See `glb`; with few faces where the settings want few."""
    return write_file(path, glb(source.hand_over, source.y_up, source.offset_m(source.y_up)))


def write_obj(source: Source, path: Path) -> list[Path]:
    """See `obj`; with few faces where the settings want few."""
    return write_file(path, obj(source.hand_over, source.y_up, source.offset_m(source.y_up)))


def write_ply(source: Source, path: Path) -> list[Path]:
    """See `ply`; with few faces where the settings want few."""
    return write_file(path, ply(source.hand_over, source.origin_m))


def glb(mesh: trimesh.Trimesh, rotation: np.ndarray, offset_m: np.ndarray = NO_OFFSET) -> bytes:
    """glTF 2.0, binary: y up, linear colours of 16 bits (8 would show bands in the dark), a dull material, and the
    expected error as `ERROR` where the mesh has it.

    Args:
        mesh: world frame, metres, with 8-bit colours.
        rotation: (3, 3) from the world to a frame with y up.
        offset_m: (3,) in that frame, where the mesh stands: its vertices are float32, the node's translation is not.
    """
    out = turned_mesh(mesh, rotation)
    out.visual = trimesh.visual.TextureVisuals(material=dull_material())
    out.vertex_attributes[COLOR] = linear(colors_of(mesh))
    expected = told_by(mesh, EXPECTED_ERROR)
    if expected is not None:
        out.vertex_attributes[ERROR] = expected.astype(np.float32)
    return gltf_bytes(out, offset_m)


def gltf_bytes(mesh: trimesh.Trimesh, offset_m: np.ndarray = NO_OFFSET) -> bytes:
    """The mesh as a GLB with its normals, colours of attribute `COLOR` named as glTF wants it; metres, as all glTF.

    Colours are shown as they are (KHR_materials_unlit): photos have their light in them.

    Args:
        offset_m: (3,) translation of the mesh's node.
    """

    def finished(tree: dict[str, Any]) -> None:
        _named(tree)
        _unlit(tree)
        tree["asset"] |= {"generator": f"room2dgs {__version__}", "extras": {"unit": "metre"}}
        if offset_m.any():
            node = next(one for one in tree["nodes"] if "mesh" in one)
            node["translation"] = offset_m.tolist()
            node["extras"] = {"offset_m": offset_m.tolist()}

    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="room", geom_name="room")
    return scene.export(file_type="glb", include_normals=True, tree_postprocessor=finished)


def dull_material(picture: Any = None) -> PBRMaterial:
    """Neither metal nor gloss, as a photographed surface that brings its light along; seen from inside alone."""
    return PBRMaterial(
        name="room", baseColorTexture=picture, baseColorFactor=[255, 255, 255, 255], metallicFactor=0.0,
        roughnessFactor=1.0,
    )  # fmt: skip


def obj(mesh: trimesh.Trimesh, rotation: np.ndarray, offset_m: np.ndarray = NO_OFFSET) -> bytes:
    """OBJ with y up and normals; colours 0..1 behind the coordinates, which most programs read.

    Args:
        rotation: (3, 3) from the world to a frame with y up.
        offset_m: (3,) in that frame, added to the vertices.
    """
    out = turned_mesh(mesh, rotation, offset_m)
    positions = np.column_stack([out.vertices, colors_of(mesh) / 255])
    parts = [
        b"# metres, y up\n",
        text_rows("v {} {} {} {} {} {}", positions, decimals=6),
        text_rows("vn {} {} {}", out.vertex_normals, decimals=4),
        text_rows("f {}//{} {}//{} {}//{}", np.repeat(np.asarray(out.faces) + 1, 2, axis=1)),
    ]
    return b"".join(parts)


def ply(mesh: trimesh.Trimesh, origin_m: Origin = AT_ORIGIN) -> bytes:
    """Binary PLY in the capture's own world, with normals.

    Args:
        origin_m: `Scene.origin_m` of the mesh's frame.
    """
    out = turned_mesh(mesh, np.eye(3), np.array(origin_m))
    out.visual = trimesh.visual.ColorVisuals(out, vertex_colors=colors_of(mesh))
    return ply_bytes(out, vertex_normal=True)


def turned_mesh(mesh: trimesh.Trimesh, rotation: np.ndarray, offset_m: np.ndarray = NO_OFFSET) -> trimesh.Trimesh:
    """A mesh without colours in another frame; each normal has length 1, also where no face has an area."""
    # of the mesh itself: it keeps them, and the next format has them ready
    normals = np.asarray(mesh.vertex_normals) @ rotation.T
    lengths = np.linalg.norm(normals, axis=1)
    normals[lengths < 0.5] = (0.0, 1.0, 0.0)
    positions = np.asarray(mesh.vertices) @ rotation.T
    if offset_m.any():
        positions = positions + offset_m
    return trimesh.Trimesh(positions, np.asarray(mesh.faces), vertex_normals=normals, process=False)


def colors_of(mesh: trimesh.Trimesh) -> np.ndarray:
    """(V, 3) uint8 sRGB; grey where the mesh has none."""
    colors = vertex_colors(mesh)
    return np.full((len(mesh.vertices), 3), 180, np.uint8) if colors is None else colors[:, :3]


def linear(colors: np.ndarray) -> np.ndarray:
    """(N, 3) uint8 sRGB to (N, 4) uint16 linear, opaque."""
    share = np.arange(256) / 255
    table = np.where(share <= SRGB_KNEE, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    levels = np.round(table * 65535).astype(np.uint16)[colors]
    return np.column_stack([levels, np.full(len(levels), 65535, np.uint16)])


def _unlit(tree: dict[str, Any]) -> None:
    for material in tree["materials"]:
        material["extensions"] = {UNLIT: {}}
    tree["extensionsUsed"] = [*tree.get("extensionsUsed", []), UNLIT]


def _named(tree: dict[str, Any]) -> None:
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            for index in primitive["attributes"].values():
                tree["bufferViews"][tree["accessors"][index]["bufferView"]]["target"] = ARRAY
            tree["bufferViews"][tree["accessors"][primitive["indices"]]["bufferView"]]["target"] = ELEMENTS
            accessor = primitive["attributes"].pop(COLOR, None)
            if accessor is not None:
                primitive["attributes"]["COLOR_0"] = accessor
                tree["accessors"][accessor]["normalized"] = True
