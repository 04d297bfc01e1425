"""A pixel's plane as (w, gx, gy): inverse depth at the pixel, 1/m, and its gradient over the image, 1/(m pixel).

With the ray r = K^-1 (x, y, 1) a plane n . P = d in the camera's frame has 1/z = (n / d) . r, which is linear in the
pixel: what PatchMatch propagates from pixel to pixel is exact.
"""

from __future__ import annotations

import cv2
import numpy as np

from room2dgs.geometry.camera import Camera


def inverse_of(depth: np.ndarray) -> np.ndarray:
    """Inverse depth of metres, float32; 0 = unknown in both."""
    return np.divide(1, depth, out=np.zeros(depth.shape, np.float32), where=depth > 0)


def plane_normals(planes: np.ndarray, camera: Camera) -> np.ndarray:
    """Normals of the planes.

    Args:
        planes: (3, H, W) float32, w <= 0 = none.
        camera: of the planes' size.

    Returns:
        (H, W, 3) float32, unit, camera frame, facing the camera; 0 where there is no plane.
    """
    w, gx, gy = planes.astype(np.float64)
    K = camera.K
    x, y = np.moveaxis(camera.pixels() - K[:2, 2], -1, 0)
    across = np.stack([gx * K[0, 0], gy * K[1, 1], w - gx * x - gy * y], axis=-1)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    there = (w > 0)[..., None] & (length > 0)
    return np.where(there, -across / np.where(length > 0, length, 1.0), 0.0).astype(np.float32)


def resized_planes(planes: np.ndarray, width: int, height: int) -> np.ndarray:
    """The planes at another image size, each taken from the pixel that covers the new pixel's centre.

    Inverse depth is continued along the plane to the new centre, so a plane stays that plane.

    Args:
        planes: (3, h, w) float32.

    Returns:
        (3, height, width) float32.
    """
    rows, columns = planes.shape[1:]
    sx, sy = columns / width, rows / height
    x, y = (np.arange(width) + 0.5) * sx, (np.arange(height) + 0.5) * sy
    column = np.minimum(x.astype(np.int64), columns - 1)
    row = np.minimum(y.astype(np.int64), rows - 1)
    w, gx, gy = planes[:, row[:, None], column[None, :]]
    there = w > 0
    moved = w + gx * (x - column - 0.5)[None, :] + gy * (y - row - 0.5)[:, None]
    moved = np.where(there, np.maximum(moved, 0.5 * w), 0.0)
    return np.stack([moved, gx * sx, gy * sy]).astype(np.float32)


def planes_of_depth(depth: np.ndarray) -> np.ndarray:
    """Planes through a depth map, their slopes from its own central differences.

    Args:
        depth: (H, W) z-depth in metres, 0 = unknown.

    Returns:
        (3, H, W) float32; the slope is 0 beside what is unknown.
    """
    there = depth > 0
    w = np.divide(1.0, depth, out=np.zeros(depth.shape, np.float32), where=there)
    known = cv2.erode(there.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    gx, gy = (cv2.Sobel(w, cv2.CV_32F, *axis, scale=1 / 8) for axis in ((1, 0), (0, 1)))
    return np.stack([w, np.where(known, gx, 0.0), np.where(known, gy, 0.0)]).astype(np.float32)
