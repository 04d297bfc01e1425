"""The boundary of a run's mesh on its page: what lies beyond it, in three colours and in metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import trimesh

from room2dgs.captures.scene import Frame
from room2dgs.eval.boundary_kinds import COLORS, NAMES, WORDS
from room2dgs.eval.pictures import camera_rays, inside
from room2dgs.eval.shading import CLAY, shade
from room2dgs.eval.sightlines import same
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.boundary_file import BoundaryEdges
from room2dgs.report.page import Figure

VIEWS, WIDTH = 4, 480  # views that are drawn, and the pixels of each
COLOR_WORDS = ("blue", "grey", "red")


def boundary_figure(mesh: trimesh.Trimesh, edges: BoundaryEdges, frames: Sequence[Frame]) -> Figure | None:
    """The mesh with its boundary in a few evenly spaced views; None without frames.

    Args:
        mesh, edges: scene's frame.
    """
    some = [frames[index].camera for index in inside(len(frames), VIEWS)]
    if not some:
        return None
    surface = Surface(mesh)
    cameras = [camera.resized_to_width(WIDTH) for camera in some]
    height = min(camera.height for camera in cameras)
    row = np.concatenate([boundary_picture(surface, edges, camera)[:height] for camera in cameras], axis=1)
    parts = ", ".join(f"{words} {color}" for words, color in zip(WORDS, COLOR_WORDS, strict=True))
    return Figure(f"The boundary of the mesh by what lies beyond it: {parts}", row)


def boundary_picture(surface: Surface, edges: BoundaryEdges, camera: Camera) -> np.ndarray:
    """(H, W, 3) 0..1: the mesh's shape, and its boundary as far as the camera sees it."""
    rays = camera_rays(camera)
    hits = surface.cast(rays.origins, rays.directions)
    clay = np.broadcast_to(CLAY, (int((hits.triangle >= 0).sum()), 3))
    picture = np.ascontiguousarray(shade(rays, hits, surface, clay), np.float32)
    depth = np.where(hits.triangle >= 0, hits.t, np.inf).reshape(camera.height, camera.width)
    middle, z = camera.project(edges.ends.mean(axis=1))
    place = np.flatnonzero(camera.inside(middle) & (z > 0))
    column, row = middle[place].astype(np.int64).T
    place = place[z[place] <= depth[row, column] + same(depth[row, column]) / 2]
    pixel, front = camera.project(edges.ends[place])
    ahead_of = np.asarray((front > 0).all(axis=1))
    for line, kind, ahead in zip(pixel, edges.kind[place], ahead_of, strict=True):
        if ahead:
            ends = np.round(line * 16).astype(np.int32).tolist()
            cv2.line(picture, ends[0], ends[1], (COLORS[kind] / 255).tolist(), 2, cv2.LINE_AA, 4)
    return picture


def boundary_sentences(metrics: Mapping[str, Any], unit: str) -> list[str]:
    """How long the boundary is, by kind; none where it was not judged."""
    metres = metrics.get("boundary_m")
    if not isinstance(metres, dict):
        return []
    parts = [f"{metres.get(name, 0.0):.1f} {unit} {words}" for name, words in zip(NAMES, WORDS, strict=True)]
    return [f"The boundary of the mesh: {', '.join(parts)}."]
