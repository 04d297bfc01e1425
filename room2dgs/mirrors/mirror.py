"""A mirror: a rectangle of glass, and what a depth map says without what it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from room2dgs.geometry.camera import Camera

NEAR_M, NEAR = 0.03, 0.03  # a depth up to so far before the glass, in metres and of the depth, is of what it shows


@dataclass(frozen=True)
class Mirror:
    """A rectangle.

    Attributes:
        corners: (4, 3) metres, counter-clockwise seen from the room.
        photos: how many of the photos that were asked show the room in it.
    """

    corners: np.ndarray
    photos: int

    @property
    def sides(self) -> np.ndarray:
        """(2, 3) from the first corner to the second and to the fourth."""
        return self.corners[[1, 3]] - self.corners[0]

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height."""
        width, height = np.linalg.norm(self.sides, axis=1)
        return float(width), float(height)

    @property
    def normal(self) -> np.ndarray:
        """(3,) unit, towards the room."""
        across = np.cross(*self.sides)
        return across / np.linalg.norm(across)

    def glass(self, camera: Camera) -> np.ndarray:
        """(H, W) z-depth of the glass, 0 in pixels whose ways do not cross it from before."""
        ray = camera.world_rays()
        along, away = ray @ self.normal, (self.corners[0] - camera.centre) @ self.normal
        before = along < -1e-9
        z = np.where(before, away / np.where(before, along, -1.0), 0.0)
        place = (camera.centre + ray * z[..., None] - self.corners[0]) @ self.sides.T / (self.sides**2).sum(axis=1)
        return np.where((z > 0) & ((place >= 0) & (place <= 1)).all(axis=-1), z, 0.0)


def shown(depth: np.ndarray, camera: Camera, mirrors: Sequence[Mirror]) -> np.ndarray:
    """(H, W) z-depth of the glass in the pixels that show what a mirror shows, 0 elsewhere.

    Args:
        depth: (H, W) z-depth, metres, 0 = unknown; what lies before a mirror is no part of what it shows.
        camera: of the size of `depth`.
    """
    found = np.zeros(depth.shape, np.float64)
    for mirror in mirrors:
        glass = mirror.glass(camera)
        inside = (glass > 0) & ((depth <= 0) | (depth > glass - np.maximum(NEAR_M, NEAR * glass)))
        found = np.where(inside & ((found == 0) | (glass < found)), glass, found)
    return found


def behind_glass(depth: np.ndarray, glass: np.ndarray) -> np.ndarray:
    """(H, W) a depth map of the room itself: the glass stands in for what is seen in it.

    Args:
        depth: (H, W) z-depth, metres, 0 = unknown, which it stays.
        glass: (H, W) of `shown`.
    """
    return np.where((glass > 0) & (depth > 0), np.minimum(depth, glass), depth).astype(depth.dtype)
