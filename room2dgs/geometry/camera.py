"""A pinhole camera with a pose."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in the house's conventions.

    Axes are OpenCV's (x right, y down, z forward). Pixel (i, j) has its centre at (i + 0.5, j + 0.5).

    Attributes:
        K: (3, 3) float64, pixels; skew is zero.
        width, height: image size in pixels.
        cam_from_world: (4, 4) float64, rigid, metres.
    """

    K: np.ndarray
    width: int
    height: int
    cam_from_world: np.ndarray

    @property
    def world_from_cam(self) -> np.ndarray:
        """(4, 4) float64, the inverse pose (camera-to-world)."""
        rotation = self.cam_from_world[:3, :3].T
        inverse = np.eye(4)
        inverse[:3, :3] = rotation
        inverse[:3, 3] = -rotation @ self.cam_from_world[:3, 3]
        return inverse

    @property
    def centre(self) -> np.ndarray:
        """(3,) float64, the projection centre in the world, metres."""
        return self.world_from_cam[:3, 3]

    @property
    def forward(self) -> np.ndarray:
        """(3,) float64, the optical axis in the world."""
        return self.cam_from_world[2, :3].copy()

    def resized(self, width: int, height: int) -> Camera:
        """The same view at another image size; focal lengths and cx, cy are scaled alike.

        With pixel centres at +0.5 a resize is a plain scaling of K's first two rows.
        """
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return replace(self, K=scale @ self.K, width=width, height=height)
