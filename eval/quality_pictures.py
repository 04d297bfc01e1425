"""Pictures of a judged mesh: its boundary, what stands in free space, and the pixels that it does not cover."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.eval.coverage import covered
from room2dgs.eval.mesh_quality import MeshQuality
from room2dgs.eval.pictures import INSIDE_VIEWS, TILE_WIDTH, camera_rays, inside, new_sheet
from room2dgs.eval.shading import mesh_color, shade
from room2dgs.eval.sightlines import Sightlines, same
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera

TEAR, EDGE, UNSEEN, FREE = (0.9, 0.1, 0.1), (0.1, 0.4, 0.9), (0.5, 0.5, 0.5), (0.75, 0.1, 0.85)
MISSED, UNKNOWN = (0.9, 0.1, 0.1), (0.95, 0.75, 0.2)
HALF = 0.55  # of a pixel's colour that an overlay takes
TITLES = (
    "photo",
    "mesh: torn red, real edges blue, no view grey, in free space violet",
    "not covered: red, yellow if no depth is known",
)


def write_quality_pictures(path: Path, found: MeshQuality, frames: Sequence[Frame]) -> None:
    """A PNG with a row for each of a few views, whole or not at all.

    Args:
        frames: those of the views that judged, in their order.

    Raises:
        InputError: a photo cannot be read.
    """
    rows = [_row(found, frames[index], found.views[index]) for index in inside(len(frames), INSIDE_VIEWS)]
    figure = new_sheet(rows, TITLES)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png")


def boundary_picture(found: MeshQuality, camera: Camera) -> np.ndarray:
    """(H, W, 3) 0..1: the mesh with its boundary and what stands in free space, as far as the camera sees them."""
    rays = camera_rays(camera)
    hits = found.surface.cast(rays.origins, rays.directions)
    picture = shade(rays, hits, found.surface, mesh_color(found.mesh, hits))
    picture = np.ascontiguousarray(picture, np.float32)
    depth = np.where(hits.triangle >= 0, hits.t, np.inf).reshape(camera.height, camera.width)
    for x, y in _shown(found.in_free_space, camera, depth)[1]:
        cv2.circle(picture, (int(x), int(y)), 1, FREE, -1)
    torn, edge, ends = found.tears.torn, found.tears.edge, found.tears.boundary.ends
    for which, color in ((~torn & ~edge, UNSEEN), (edge, EDGE), (torn, TEAR)):
        some = ends[which]
        shown, _ = _shown(some.mean(axis=1), camera, depth)
        pixel, z = camera.project(some[shown])
        for line in np.round(pixel[(z > 0).all(axis=1)] * 16).astype(np.int32):
            cv2.line(picture, line[0].tolist(), line[1].tolist(), color, 1, cv2.LINE_AA, 4)
    return picture


def uncovered_picture(photo: np.ndarray, view: Sightlines) -> np.ndarray:
    """(H, W, 3) 0..1: the photo, 0..1, with the pixels that the mesh does not cover."""
    missed = view.usable & ~covered(view.mesh, view.depth)
    picture = photo.astype(np.float32)
    for which, color in ((missed & (view.depth == 0), UNKNOWN), (missed & (view.depth > 0), MISSED)):
        large = cv2.resize(which.astype(np.uint8), photo.shape[1::-1], interpolation=cv2.INTER_NEAREST_EXACT) > 0
        picture[large] = (1 - HALF) * picture[large] + HALF * np.array(color, np.float32)
    return picture


def _row(found: MeshQuality, frame: Frame, view: Sightlines) -> list[np.ndarray]:
    camera = frame.camera.resized_to_width(TILE_WIDTH)
    photo = cv2.resize(frame.color(), camera.size, interpolation=cv2.INTER_AREA) / 255
    return [photo, boundary_picture(found, camera), uncovered_picture(photo, view)]


def _shown(points: np.ndarray, camera: Camera, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which points (N, 3) the camera sees in front of the mesh, and (M, 2) their pixels."""
    pixel, z = camera.project(points)
    place = np.flatnonzero(camera.inside(pixel) & (z > 0))
    column, row = pixel[place].astype(np.int64).T
    front = depth[row, column]
    place = place[z[place] <= front + same(front) / 2]
    return place, pixel[place]
