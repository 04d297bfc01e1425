"""Photos to one picture on a mesh: weighed by how well each sees a place, evened out in exposure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scipy.ndimage import distance_transform_edt

from room2dgs.captures.scene import Frame
from room2dgs.export.mesh_files import colors_of
from room2dgs.export.texture.charts import Charts, Texels
from room2dgs.export.texture.photos import SHARPNESS, Occluder, full_size, gains, seen

SAMPLE = 20_000  # points at which photos are compared


def baked(
    mesh: trimesh.Trimesh, whole: trimesh.Trimesh, found: Charts, shown: Texels, frames: Sequence[Frame], side_px: int
) -> tuple[np.ndarray, float]:
    """The picture.

    Args:
        mesh: what `found` are the charts of; its vertices' colours go where no photo looks.
        whole: hides what is behind it.
        frames: the photos, with their cameras.

    Returns:
        (H, W, 3) uint8 sRGB, filled beyond the charts too, and the share of the surface's texels that a photo sees.
    """
    occluder = Occluder(whole)
    normals = np.asarray(mesh.vertex_normals)[found.source]
    points = shown.of_vertices(found.faces, found.vertices)
    facing = shown.of_vertices(found.faces, normals)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
    some = np.random.default_rng(0).permutation(len(points))[:SAMPLE]
    brightness = gains(frames, occluder, points[some], facing[some])
    total, weight = np.zeros((len(points), 3)), np.zeros(len(points))
    for frame, gain in zip(full_size(frames), brightness, strict=True):
        part = seen(frame, occluder, points, facing)
        quality = (part.quality / frame.camera.width).astype(
            np.float64
        ) ** SHARPNESS  # of the scene's size, not the photo's
        total[part.points] += part.color / gain * quality[:, None]
        weight[part.points] += quality
    colors = colors_of(mesh).astype(np.float64)[found.source]
    color = shown.of_vertices(found.faces, colors)
    known = weight > 0
    color[known] = total[known] / weight[known, None]
    picture = np.zeros((side_px, side_px, 3), np.uint8)
    covered = np.zeros((side_px, side_px), bool)
    rows, columns = shown.texel.T
    picture[rows, columns] = np.round(color.clip(0, 255))
    covered[rows, columns] = True
    return spread(picture, covered), float(known.mean()) if len(known) else 0.0


def spread(picture: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """The picture with every texel that shows nothing as its nearest one: smaller versions of it have no dark seams."""
    if not covered.any():
        return picture
    rows, columns = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return picture[rows, columns]
