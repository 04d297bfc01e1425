"""Photos to one picture on a mesh: each texel from the photos that see it best, evened out in exposure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import trimesh
from scipy.ndimage import distance_transform_edt

from room2dgs.captures.scene import Frame
from room2dgs.export.mesh_files import colors_of
from room2dgs.export.texture.charts import Charts, Texels
from room2dgs.mesh.coloring.best import Points, Progress, best_colors
from room2dgs.mesh.coloring.drawn import Surface
from room2dgs.mesh.coloring.levels import levels_of
from room2dgs.mesh.coloring.vertices import vertex_points

WIDEST_PX = 2048  # photos are used at their own size up to this
PART = 6_000_000  # texels that are coloured at a time; memory follows them


def baked(
    mesh: trimesh.Trimesh,
    whole: trimesh.Trimesh,
    found: Charts,
    shown: Texels,
    frames: Sequence[Frame],
    side_px: int,
    progress: Progress | None = None,
) -> tuple[np.ndarray, float]:
    """The picture.

    Args:
        mesh: what `found` are the charts of; its vertices' colours go where no photo looks.
        whole: hides what is behind it.
        frames: the photos, with their cameras.

    Returns:
        (H, W, 3) uint8 sRGB, filled beyond the charts too, and the share of the surface's texels that a photo sees.
    """
    surface = Surface(whole)
    levels = levels_of(vertex_points(whole), surface, frames)
    normals = np.asarray(mesh.vertex_normals)[found.source]
    own = colors_of(mesh).astype(np.float64)[found.source]
    side_m = np.sqrt(mesh.area / max(len(shown.face), 1))
    picture, covered = np.zeros((side_px, side_px, 3), np.uint8), np.zeros((side_px, side_px), bool)
    large, seen = list(full_size(frames)), 0
    for first in range(0, len(shown.face), PART):
        part = Texels(*(values[first : first + PART] for values in shown))
        facing = part.of_vertices(found.faces, normals)
        facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
        places = part.of_vertices(found.faces, found.vertices).astype(np.float32)
        points = Points(places, facing.astype(np.float32), np.full(len(places), side_m, np.float32))
        color, known = best_colors(points, surface, large, levels, progress)
        color[~known] = part.of_vertices(found.faces, own)[~known]
        rows, columns = part.texel.T
        picture[rows, columns] = np.round(color.clip(0, 255))
        covered[rows, columns] = True
        seen += int(known.sum())
    return spread(picture, covered), seen / max(len(shown.face), 1)


def full_size(frames: Iterable[Frame]) -> Iterable[Frame]:
    """The frames with photos at their own size, or `WIDEST_PX` wide."""
    for frame in frames:
        width, height = frame.full_size()
        size = min(1.0, WIDEST_PX / width)
        camera = frame.camera.resized(max(1, round(width * size)), max(1, round(height * size)))
        yield replace(frame, camera=camera, cache=None)


def spread(picture: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """The picture with every texel that shows nothing as its nearest one: smaller versions of it have no dark seams."""
    if not covered.any():
        return picture
    rows, columns = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return picture[rows, columns]
