"""What sparse points tell stereo before it begins: a first plane here and there, and the range of depths to search."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from room2dgs.geometry.camera import Camera

REACH = 1 / 16  # of the photo's width: how far a point lends its depth
FEW_POINTS = 50  # fewer say little about a view's range of depths
NEARER, FARTHER = 0.6, 1.5  # beyond the nearest and farthest per cent of the points


def planes_from_points(pixel: np.ndarray, depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Planes that face the camera, each pixel's at the depth of the nearest point within reach.

    Args:
        pixel: (N, 2) where the camera sees the points; depth: (N,) metres.

    Returns:
        (3, H, W) float32; w = 0 where no point is near.
    """
    planes = np.zeros((3, camera.height, camera.width), np.float32)
    if len(pixel):
        pixels = camera.pixels().reshape(-1, 2)
        distance, nearest = cKDTree(pixel).query(pixels, distance_upper_bound=REACH * camera.width)
        found = np.isfinite(distance)
        planes[0].reshape(-1)[found] = 1 / depth[nearest[found]]
    return planes


def depth_range(depth: np.ndarray, all_depths: np.ndarray) -> tuple[float, float]:
    """Nearest and farthest depth to search, metres.

    Args:
        depth: (N,) of the points that the view sees; with few of them those of all views, `all_depths`, count.
    """
    known = depth if len(depth) >= FEW_POINTS else all_depths
    near, far = np.percentile(known, (1, 99))
    return NEARER * float(near), FARTHER * float(far)


def wider_range(known: tuple[float, float], depth: np.ndarray) -> tuple[float, float]:
    """A range of depths that holds those of a map, too.

    Args:
        known: nearest and farthest, metres.
        depth: metres, 0 = unknown.
    """
    there = depth[depth > 0]
    if not len(there):
        return known
    return min(known[0], NEARER * float(there.min())), max(known[1], FARTHER * float(there.max()))
