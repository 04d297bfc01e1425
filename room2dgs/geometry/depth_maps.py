"""Rays of a camera's pixels, normals of a depth map, points seen by a camera."""

from __future__ import annotations

import numpy as np

from room2dgs.geometry.camera import Camera


def pixel_rays(camera: Camera) -> np.ndarray:
    """(H, W, 3) float64 directions through the pixels' centres, camera frame, z = 1."""
    K = camera.K
    x = (np.arange(camera.width) + 0.5 - K[0, 2]) / K[0, 0]
    y = (np.arange(camera.height) + 0.5 - K[1, 2]) / K[1, 1]
    return np.stack([*np.meshgrid(x, y), np.ones((camera.height, camera.width))], axis=-1)


def depth_normals(depth: np.ndarray, camera: Camera, step: int = 1, max_jump: float = 0.1) -> np.ndarray:
    """Normals by central differences over 2 x `step` pixels.

    A wider step averages out the rounding of a depth map in millimetres.

    Args:
        depth: (H, W) z-depth, metres; 0 = invalid.
        camera: of the depth map's size.
        step: pixels to either side.
        max_jump: neighbours whose depth differs by a larger fraction lie on another surface.

    Returns:
        (H, W, 3) float64, unit, camera frame, facing the camera; 0 where a neighbour is invalid, on
        another surface or outside the image.
    """
    points = pixel_rays(camera) * depth[..., None]
    normal = np.zeros_like(points)
    height, width = depth.shape
    if min(height, width) <= 2 * step:
        return normal
    inner = (slice(step, -step), slice(step, -step))
    right, left = (step, 2 * step), (step, 0)
    below, above = (2 * step, step), (0, step)

    def shifted(values: np.ndarray, corner: tuple[int, int]) -> np.ndarray:
        return values[corner[0] : corner[0] + height - 2 * step, corner[1] : corner[1] + width - 2 * step]

    middle = depth[inner]
    valid = middle > 0
    for corner in (right, left, below, above):
        neighbour = shifted(depth, corner)
        valid &= (neighbour > 0) & (np.abs(neighbour - middle) <= max_jump * middle)
    # y x x: with y down and z forward this points back at the camera
    across = np.cross(shifted(points, below) - shifted(points, above), shifted(points, right) - shifted(points, left))
    length = np.linalg.norm(across, axis=-1)
    valid &= length > 0
    normal[inner] = np.where(valid[..., None], across / np.where(length > 0, length, 1.0)[..., None], 0.0)
    return normal


def project(xyz: np.ndarray, camera: Camera, near_m: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """The points that fall into a camera's image, hidden ones among them.

    Args:
        xyz: (M, 3) metres, world frame.

    Returns:
        (N, 2) int64 pixel (column, row) and (N,) float64 z-depth in metres, in the points' order.
    """
    in_cam = xyz @ camera.cam_from_world[:3, :3].T + camera.cam_from_world[:3, 3]
    in_cam = in_cam[in_cam[:, 2] > near_m]
    z = in_cam[:, 2]
    pixel = np.floor(in_cam[:, :2] / z[:, None] * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2])
    inside = (pixel >= 0).all(axis=1) & (pixel[:, 0] < camera.width) & (pixel[:, 1] < camera.height)
    return pixel[inside].astype(np.int64), z[inside]


def unhidden(pixel: np.ndarray, z: np.ndarray, cell_px: int, slack: float = 1.25) -> np.ndarray:
    """Which points are not plainly behind another one in the same cell of the image.

    Sparse points know no surfaces between them, so this thins the hidden ones out and no more.

    Args:
        pixel, z: what `project` gives.
        cell_px: the cell's side.
        slack: a point is hidden if it is this many times as far as its cell's nearest.

    Returns:
        (N,) bool.
    """
    if not len(z):
        return np.zeros(0, dtype=bool)
    cells = np.unique(pixel // cell_px, axis=0, return_inverse=True)[1].reshape(-1)
    nearest = np.full(cells.max() + 1, np.inf)
    np.minimum.at(nearest, cells, z)
    return z <= slack * nearest[cells]
