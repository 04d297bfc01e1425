"""A mesh's vertices in the photos' colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from room2dgs.captures.scene import Frame
from room2dgs.mesh.coloring.best import Levels, Points, Progress, best_colors
from room2dgs.mesh.coloring.drawn import Surface
from room2dgs.mesh.coloring.levels import levels_of
from room2dgs.mesh.coloring.spread import spread_colors
from room2dgs.mesh.vertex_colors import vertex_colors
from room2dgs.mesh.vertex_source import copied_source

GREY = 180  # of a piece that no photo sees, if the mesh has no colours


def photo_colored(
    mesh: trimesh.Trimesh, frames: Sequence[Frame], progress: Progress | None = None
) -> tuple[trimesh.Trimesh, float]:
    """The mesh with its vertices in the colours of the photos that see them best (`best_colors`).

    What no photo sees, such as filled holes, takes the colours around it; a piece that none sees keeps its own.

    Args:
        mesh: scene's frame; faces wind counter-clockwise seen from the cameras.
        frames: photos and cameras; at most their cameras' pixels are used.

    Returns:
        The mesh, its vertices and faces as they were, and the share of its vertices that a photo sees.
    """
    surface = Surface(mesh)
    points = vertex_points(mesh)
    levels = levels_of(points, surface, frames) if len(frames) > 1 else Levels.alike(len(frames))
    found, known = best_colors(points, surface, frames, levels, progress)
    before = vertex_colors(mesh)
    colors = np.full((len(known), 3), GREY, np.float64) if before is None else before[:, :3].astype(np.float64)
    colors[known] = found[known]
    colors = spread_colors(colors, known, surface.faces)
    levelled = np.round(colors).clip(0, 255).astype(np.uint8)
    result = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=levelled, process=False)
    return copied_source(result, mesh), float(known.mean()) if len(known) else 0.0


def vertex_points(mesh: trimesh.Trimesh) -> Points:
    """The vertices with their normals, and the mean length of their edges."""
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    corners = vertices[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    count = len(vertices)
    normals = np.stack([np.bincount(faces.ravel(), np.repeat(axis, 3), count) for axis in weighted.T], axis=1)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    around = (lengths + np.roll(lengths, 1, axis=1)) / 2  # of the two edges at each corner
    edges = np.bincount(faces.ravel(), around.ravel(), count) / np.maximum(
        np.bincount(faces.ravel(), minlength=count), 1
    )
    return Points(vertices.astype(np.float32), normals.astype(np.float32), edges.astype(np.float32))
