"""Heights of a surface over small squares of planes, by rays across them."""

from __future__ import annotations

import numpy as np

from room2dgs.eval.surface import Surface


def heights(
    surface: Surface, points: np.ndarray, normals: np.ndarray, size_m: float, steps: int, reach_m: float
) -> np.ndarray:
    """(N, steps, steps) heights, metres, along the normals over a square about each point; NaN where there are none.

    Args:
        points, normals: (N, 3); unit normals, to the side from which the surface is looked at.
        size_m: of the square, between the outer rays.
        reach_m: of two surfaces the one in front counts; none farther from the plane than this is found.
    """
    right, up = tangents(normals)
    offset = np.linspace(-size_m / 2, size_m / 2, steps)
    grid = offset[:, None, None] * up[:, None, None] + offset[:, None] * right[:, None, None]
    origins = points[:, None, None] + reach_m * normals[:, None, None] + grid
    directions = np.broadcast_to(-normals[:, None, None], origins.shape)
    t = surface.cast(origins.reshape(-1, 3), directions.reshape(-1, 3)).t.astype(np.float64)
    found = np.where(t <= 2 * reach_m, reach_m - t, np.nan)
    return found.reshape(len(points), steps, steps)


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) two unit vectors across each normal: right x up = normal."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    right = np.cross(axis, normals)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-12)
    return right, np.cross(normals, right)


def slopes(height: np.ndarray, size_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least-squares plane over each square: (N,) height in the middle, (N,) slope to the right and (N,) up.

    NaN where a height is.
    """
    steps = height.shape[-1]
    offset = np.linspace(-size_m / 2, size_m / 2, steps)
    square = steps * (offset**2).sum()
    return (
        height.mean(axis=(1, 2)),
        np.einsum("nij,j->n", height, offset) / square,
        np.einsum("nij,i->n", height, offset) / square,
    )


def residuals(height: np.ndarray, size_m: float) -> np.ndarray:
    """(N, steps, steps) heights over the plane of `slopes`."""
    middle, right, up = slopes(height, size_m)
    offset = np.linspace(-size_m / 2, size_m / 2, height.shape[-1])
    return (
        height
        - middle[:, None, None]
        - right[:, None, None] * offset[None, None, :]
        - up[:, None, None] * offset[None, :, None]
    )
