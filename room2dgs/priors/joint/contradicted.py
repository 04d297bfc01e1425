"""Where the sparse points contradict a depth map."""

from __future__ import annotations

import cv2
import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.depth_maps import project, unhidden

OFF = 0.05  # of the depth: a point that is further from the map speaks against it
REACH = 1 / 40  # of the width: deviation of the Gaussian with which a point speaks for what is around it
CELLS = 160  # across, on which the points are counted
MIN_SUPPORT = 0.1  # of the weight of one point upon its own cell; further from all points nothing is contradicted
MAX_SHARE = 1 / 3  # of the points around a pixel may be off


def contradicted(depth: np.ndarray, camera: Camera, xyz: np.ndarray) -> np.ndarray:
    """Pixels around which more than a third of the sparse points are off the map.

    A network's soft edges and wrong regions lie where photos have texture, and so do the points: there the map can be
    checked, and is not needed. Far from all points, on a blank wall, it stays.

    Args:
        depth: (H, W) metres, 0 = invalid.
        xyz: (M, 3) sparse points, metres, world frame.

    Returns:
        (H, W) bool.
    """
    height, width = depth.shape
    pixel, z = project(xyz, camera)
    seen = unhidden(pixel, z, cell_px=max(4, width // 24))
    pixel, z = pixel[seen], z[seen]
    at = depth[pixel[:, 1], pixel[:, 0]]
    pixel, z, at = pixel[at > 0], z[at > 0], at[at > 0]
    cell = max(1, width // CELLS)
    counts = np.zeros((2, -(-height // cell), -(-width // cell)))
    off = (np.abs(at / z - 1) > OFF).astype(int)
    np.add.at(counts, (off, pixel[:, 1] // cell, pixel[:, 0] // cell), 1.0)
    sigma = REACH * width / cell
    good, bad = (cv2.GaussianBlur(count, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) for count in counts)
    alone = 1 / (2 * np.pi * sigma**2)  # what one point gives its own cell
    doubtful = (bad > MAX_SHARE * (good + bad)) & (good + bad > MIN_SUPPORT * alone)
    return np.repeat(np.repeat(doubtful, cell, axis=0), cell, axis=1)[:height, :width]
