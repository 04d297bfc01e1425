"""The textured mesh as GLB, and as OBJ with its material and picture beside it."""

from __future__ import annotations

import io
import math
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from PIL import Image

from room2dgs.captures.scene import Frame
from room2dgs.export.local_files import write_file
from room2dgs.export.mesh_files import ERROR, NO_OFFSET, dull_material, gltf_bytes, turned_mesh
from room2dgs.export.source import Source
from room2dgs.export.text_rows import text_rows
from room2dgs.export.texture.bake import baked
from room2dgs.export.texture.charts import Charts, charts, texels
from room2dgs.files import whole_file
from room2dgs.logs import Log
from room2dgs.mesh.coloring.best import Progress
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, told_by, with_nearest_error

JPEG_QUALITY = 90
QUIET_S = 10.0
LEAST_PX = 256
TEXELS_A_PIXEL = 4  # of the photos: half of a picture is used, and texels do not lie as pixels do
MATERIAL = """# dull, as a photographed surface that brings its light along
newmtl room
Ka 0 0 0
Kd 1 1 1
Ks 0 0 0
illum 1
map_Kd room.png
"""


class Textured(NamedTuple):
    """A mesh with a picture.

    Attributes:
        mesh: the simplified one, world frame.
        charts: its charts in the picture.
        picture: (H, W, 3) uint8 sRGB.
    """

    mesh: trimesh.Trimesh
    charts: Charts
    picture: np.ndarray


def textured(source: Source) -> Textured:
    """Simplified, cut into charts, baked from the training photos."""
    from room2dgs.mesh.simplify import simplified

    settings, frames = source.config.export, source.scene.train
    mesh = source.hand_over
    if settings.faces is None and settings.max_error_m is None:
        result = simplified(source.mesh, settings.texture_faces)
        mesh = with_nearest_error(result.mesh, source.mesh)
        source.log(f"textured mesh: {len(source.mesh.faces):,} faces to {len(mesh.faces):,}, {result.sentence}")
    side_px = picture_side(frames, settings.texture_px)
    found = charts(mesh, side_px)
    source.log(f"textured mesh: laid flat, {len(frames)} photos to look at")
    shown = texels(found, side_px)
    progress = now_and_then(source.log)
    picture, share = baked(mesh, source.mesh, found, shown, frames, side_px, progress)
    used = len(shown.face) / side_px**2
    side_mm = 1000 * np.sqrt(mesh.area / max(len(shown.face), 1))
    source.log(
        f"textured mesh: {100 * share:.0f}% of the surface from photos, texels of {side_mm:.1f} mm, "
        f"{100 * used:.0f}% of the picture used"
    )
    return Textured(mesh, found, picture)


def picture_side(frames: Sequence[Frame], most_px: int) -> int:
    """Side of the picture: a power of two with room for every pixel of the photos, or `most_px` if that is less."""
    pixels = TEXELS_A_PIXEL * sum(frame.camera.width * frame.camera.height for frame in frames)
    return min(most_px, max(LEAST_PX, 2 ** math.ceil(math.log2(max(pixels, 1)) / 2)))


def now_and_then(log: Log) -> Progress:
    """Logs how many photos are done, every `QUIET_S` seconds."""
    said = time.monotonic()

    def progress(done: int, count: int) -> None:
        nonlocal said
        if time.monotonic() - said > QUIET_S:
            log(f"textured mesh: {done} of {count} photos")
            said = time.monotonic()

    return progress


def write_textured_glb(source: Source, path: Path) -> list[Path]:
    """One file, with y up."""
    return write_file(path, glb_of(*source.textured, source.y_up, source.offset_m(source.y_up)))


def write_textured_obj(source: Source, folder: Path) -> list[Path]:
    """room.obj, room.mtl and room.png; the vertices are in the capture's own world, with y up."""
    buffer = io.BytesIO()
    Image.fromarray(source.textured.picture).save(buffer, "PNG")
    files = {
        "room.png": buffer.getvalue(),
        "room.mtl": MATERIAL.encode(),
        "room.obj": obj_of(source.textured.mesh, source.textured.charts, source.y_up, source.offset_m(source.y_up)),
    }
    for name, data in files.items():
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(data)
    return [folder / name for name in files]


def obj_of(mesh: trimesh.Trimesh, found: Charts, rotation: np.ndarray, offset_m: np.ndarray = NO_OFFSET) -> bytes:
    """OBJ with y up; places and normals are the mesh's own, so that charts do not tear it apart.

    Args:
        rotation: (3, 3) from the world to a frame with y up.
        offset_m: (3,) in that frame, added to the vertices.
    """
    out = turned_mesh(mesh, rotation, offset_m)
    positions, corners = found.source[found.faces] + 1, found.faces + 1  # (F, 3) each
    parts = [
        b"# metres, y up\nmtllib room.mtl\n",
        text_rows("v {} {} {}", out.vertices, decimals=6),
        text_rows("vt {} {}", found.uv, decimals=6),
        text_rows("vn {} {} {}", out.vertex_normals, decimals=4),
        b"usemtl room\n",
        text_rows("f {}/{}/{} {}/{}/{} {}/{}/{}", np.stack([positions, corners, positions], axis=2).reshape(-1, 9)),
    ]
    return b"".join(parts)


def turned_charts(mesh: trimesh.Trimesh, found: Charts, rotation: np.ndarray) -> trimesh.Trimesh:
    """The charts' faces in another frame, with unit normals of the mesh that they were cut from."""
    normals = np.asarray(mesh.vertex_normals)[found.source] @ rotation.T
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0.5, normals / np.maximum(lengths, 1e-9), (0.0, 1.0, 0.0))
    return trimesh.Trimesh(found.vertices @ rotation.T, found.faces, vertex_normals=normals, process=False)


def jpeg_of(picture: np.ndarray) -> bytes:
    """(H, W, 3) uint8 sRGB as a file, colours as fine as light."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return buffer.getvalue()


def kept_jpeg(image: Image.Image) -> Image.Image:
    """A JPEG that is written as it was read: trimesh would encode it again, coarser."""
    setattr(image, "save", partial(image.save, quality="keep"))  # noqa: B010 - of this picture alone
    return image


def glb_of(
    mesh: trimesh.Trimesh,
    found: Charts,
    picture: np.ndarray,
    rotation: np.ndarray,
    offset_m: np.ndarray = NO_OFFSET,
) -> bytes:
    """The mesh with the picture (sRGB, as glTF wants base colours) and its normals.

    Args:
        rotation: (3, 3) from the world to a frame with y up.
        offset_m: (3,) in that frame, where the mesh stands.
    """
    out = turned_charts(mesh, found, rotation)
    image = kept_jpeg(Image.open(io.BytesIO(jpeg_of(picture))))
    out.visual = trimesh.visual.TextureVisuals(uv=found.uv, material=dull_material(image))
    expected = told_by(mesh, EXPECTED_ERROR)
    if expected is not None:
        out.vertex_attributes[ERROR] = expected[found.source]
    return gltf_bytes(out, offset_m)
