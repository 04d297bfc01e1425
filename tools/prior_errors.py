"""Smooth random fields, and depth and normals spoilt with them the way networks spoil theirs."""

from __future__ import annotations

import cv2
import numpy as np

WAVES = 48


def image_field(rng: np.random.Generator, height: int, width: int, bumps: float) -> np.ndarray:
    """(height, width) smooth noise, mean 0, deviation about 1, about `bumps` bumps along the longer side."""
    cells = max(2, round(bumps) + 1)
    rows = max(2, round(cells * height / max(height, width)))
    columns = max(2, round(cells * width / max(height, width)))
    # a margin of cells, so that the border is as rough as the middle
    coarse = rng.normal(size=(rows + 4, columns + 4))
    fine_size = (round(width * (columns + 4) / columns), round(height * (rows + 4) / rows))
    fine = cv2.resize(coarse, fine_size, interpolation=cv2.INTER_CUBIC)
    top, left = (fine.shape[0] - height) // 2, (fine.shape[1] - width) // 2
    field = fine[top : top + height, left : left + width]
    return field / 0.77  # what cubic interpolation leaves of the deviation


class WorldField:
    """Smooth noise over the world: what all views get wrong alike. Mean 0, deviation 1."""

    def __init__(self, rng: np.random.Generator, wavelength_m: float, channels: int = 1):
        direction = rng.normal(size=(WAVES, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        self.waves = direction * (2.0 * np.pi / wavelength_m) * rng.uniform(0.5, 1.0, size=(WAVES, 1))
        self.phases = rng.uniform(0.0, 2.0 * np.pi, size=(channels, WAVES))

    def at(self, xyz: np.ndarray) -> np.ndarray:
        """(H, W, channels) of (H, W, 3) world points; computed at a quarter of the size."""
        height, width = xyz.shape[:2]
        angles = xyz[::4, ::4] @ self.waves.T
        coarse = np.stack([np.cos(angles + phase).sum(axis=-1) for phase in self.phases], axis=-1)
        values = cv2.resize(coarse * np.sqrt(2.0 / WAVES), (width, height), interpolation=cv2.INTER_LINEAR)
        return values.reshape(height, width, -1)


def blurred_depth(depth: np.ndarray, sigma_px: float) -> np.ndarray:
    """Gaussian blur of the valid pixels' disparity: edges bleed, holes (0) stay holes."""
    if sigma_px <= 0:
        return depth
    valid = depth > 0
    disparity = np.where(valid, 1.0 / np.where(valid, depth, 1.0), 0.0)
    total = cv2.GaussianBlur(valid.astype(np.float64), (0, 0), sigma_px)
    mean = cv2.GaussianBlur(disparity, (0, 0), sigma_px)
    return np.where(valid, total / np.maximum(mean, 1e-12), 0.0)


def turned(normal: np.ndarray, error: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Normals with an error added across them, kept on the side that faces the camera.

    Args:
        normal: (H, W, 3) unit, facing the camera; 0 = none.
        error: (H, W, 3); its part across the normal is the tangent of the angle.
        rays: (H, W, 3) pixel rays in the normals' frame.
    """
    across = error - (error * normal).sum(axis=-1, keepdims=True) * normal
    result = normal + across
    view = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    side = (result * view).sum(axis=-1, keepdims=True)
    # an edge-on normal is the last that can be seen
    result = np.where(side > -0.02, result - (side + 0.02) * view, result)
    length = np.linalg.norm(result, axis=-1, keepdims=True)
    return np.where((length > 0) & normal.any(axis=-1, keepdims=True), result / np.where(length > 0, length, 1.0), 0.0)
