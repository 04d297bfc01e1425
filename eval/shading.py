"""Headless pictures of a mesh by ray casting; no OpenGL."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from room2dgs.eval.surface import Hits, Surface

AMBIENT = 0.45  # light on a surface seen edge-on; the rest is a head light
NOTHING = np.array([1.0, 1.0, 1.0])  # where no surface is
UNKNOWN = np.array([0.75, 0.75, 0.75])  # no ground truth there
CLAY = np.array([0.8, 0.8, 0.78])  # a mesh without colours
# blue, green, yellow, red; the last from the end of the scale up
RAMP = np.array([[0.15, 0.30, 0.80], [0.20, 0.70, 0.35], [0.98, 0.85, 0.20], [0.85, 0.10, 0.10]])


@dataclass(frozen=True)
class Rays:
    """A picture's rays.

    Attributes:
        origins: (H W, 3) or (3,), world.
        directions: (H W, 3), world.
        width, height: pixels; rays go row by row.
    """

    origins: np.ndarray
    directions: np.ndarray
    width: int
    height: int

    def picture(self, colors: np.ndarray) -> np.ndarray:
        """(H, W, 3) from one colour a ray."""
        return colors.reshape(self.height, self.width, 3)

    def at(self, hits: Hits) -> np.ndarray:
        """(M, 3) points of the rays that hit something."""
        found = hits.triangle >= 0
        origins = np.broadcast_to(self.origins, self.directions.shape)[found]
        return origins + hits.t[found, None] * self.directions[found]


def error_color(distance: np.ndarray, full_m: float) -> np.ndarray:
    """(N, 3) colours 0..1 of distances in metres: blue at 0, red from `full_m` up."""
    place = np.clip(distance / full_m, 0, 1) * (len(RAMP) - 1)
    return np.stack([np.interp(place, np.arange(len(RAMP)), RAMP[:, k]) for k in range(3)], axis=-1)


def mesh_color(mesh: trimesh.Trimesh, hits: Hits) -> np.ndarray:
    """(M, 3) the mesh's vertex colours (grey clay without) where rays hit it."""
    found = hits.triangle >= 0
    visual = mesh.visual
    if not isinstance(visual, trimesh.visual.ColorVisuals) or visual.kind != "vertex":
        return np.broadcast_to(CLAY, (int(found.sum()), 3))
    corners = np.asarray(visual.vertex_colors)[np.asarray(mesh.faces)[hits.triangle[found]], :3] / 255
    u, v = hits.uv[found, :1], hits.uv[found, 1:]
    return (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]


def shade(rays: Rays, hits: Hits, surface: Surface, colors: np.ndarray) -> np.ndarray:
    """(H, W, 3) picture 0..1: the hits' colours under a head light, white where nothing is hit."""
    found = hits.triangle >= 0
    directions = rays.directions[found]
    facing = np.abs(np.einsum("nc,nc->n", surface.face_normals[hits.triangle[found]], directions))
    facing /= np.linalg.norm(directions, axis=1)
    picture = np.broadcast_to(NOTHING, (len(found), 3)).copy()
    picture[found] = colors * (AMBIENT + (1 - AMBIENT) * facing[:, None])
    return rays.picture(picture)
