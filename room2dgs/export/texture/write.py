"""The textured mesh as GLB."""

from __future__ import annotations

import io

import numpy as np
import trimesh
from PIL import Image

from room2dgs.export.mesh_files import dull_material, gltf_bytes
from room2dgs.export.source import Source
from room2dgs.export.texture.bake import baked
from room2dgs.export.texture.charts import Charts, charts, texels

JPEG_QUALITY = 90


def textured_glb(source: Source) -> bytes:
    """Simplified, cut into charts, baked from the training photos."""
    from room2dgs.mesh.simplify import simplified

    settings = source.config.export
    mesh = source.hand_over
    if settings.faces is None and settings.max_error_m is None:
        result = simplified(source.mesh, settings.texture_faces)
        mesh = result.mesh
        source.log(f"textured mesh: {len(source.mesh.faces):,} faces to {len(mesh.faces):,}, {result.sentence}")
    found = charts(mesh, settings.texture_px)
    shown = texels(found, settings.texture_px)
    picture, share = baked(mesh, source.mesh, found, shown, source.scene.train, settings.texture_px)
    used = len(shown.face) / settings.texture_px**2
    side_mm = 1000 * np.sqrt(mesh.area / max(len(shown.face), 1))
    source.log(
        f"textured mesh: {100 * share:.0f}% of the surface from photos, texels of {side_mm:.1f} mm, "
        f"{100 * used:.0f}% of the picture used"
    )
    return glb_of(mesh, found, picture, source.y_up)


def glb_of(mesh: trimesh.Trimesh, found: Charts, picture: np.ndarray, rotation: np.ndarray) -> bytes:
    """The mesh with the picture (sRGB, as glTF wants base colours) and its normals.

    Args:
        rotation: (3, 3) from the world to a frame with y up.
    """
    normals = np.asarray(mesh.vertex_normals)[found.source] @ rotation.T
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0.5, normals / np.maximum(lengths, 1e-9), (0.0, 1.0, 0.0))
    out = trimesh.Trimesh(found.vertices @ rotation.T, found.faces, vertex_normals=normals, process=False)
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    out.visual = trimesh.visual.TextureVisuals(uv=found.uv, material=dull_material(Image.open(buffer)))
    return gltf_bytes(out)
