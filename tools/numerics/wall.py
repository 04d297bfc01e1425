"""A wall before a few cameras: what the hard cases of stereo and joint depth look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.geometry.camera import Camera

WIDTH, HEIGHT, FOCAL, WALL_M = 64, 48, 60.0, 2.0


class StageResult(NamedTuple):
    """What a stage made of a case.

    Attributes:
        asked: what `off` is.
        off: how far the answer is from the known one.
        bound: of it.
        finite: all numbers are.
        same: the same bits on any number of threads, and again.
    """

    asked: str
    off: float
    bound: float
    finite: bool
    same: bool

    @property
    def passed(self) -> bool:
        return self.finite and self.same and self.off <= self.bound


def camera_at(x: float, turned: bool = False) -> Camera:
    """Looks along z of the world, or away from it."""
    rotation = np.diag([-1.0, 1.0, -1.0]) if turned else np.eye(3)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ [x, 0.02, 0.0]
    return Camera(np.array([[FOCAL, 0, WIDTH / 2 + 1], [0, FOCAL, HEIGHT / 2 - 2], [0, 0, 1]]), WIDTH, HEIGHT, pose)


def photo_of(camera: Camera, textured: bool = True) -> np.ndarray:
    """(H, W) uint8 of a wall at z = 2 m, with a smooth pattern or without."""
    if not textured:
        return np.full((HEIGHT, WIDTH), 180, np.uint8)
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    X = (x - camera.K[0, 2]) / FOCAL * WALL_M + camera.centre[0]
    Y = (y - camera.K[1, 2]) / FOCAL * WALL_M
    wave = np.sin(19 * X + 5 * Y) + np.cos(23 * Y - 7 * X) + 0.7 * np.sin(41 * X) * np.cos(37 * Y)
    return np.clip(128 + 40 * wave, 0, 255).astype(np.uint8)
