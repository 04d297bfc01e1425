"""Where the sparse points contradict a depth map."""

from __future__ import annotations

import cv2
import numpy as np

from room2dgs.captures.seen_points import SeenPoints

OFF = 0.05  # of the depth: a point that is further from the map speaks against it
REACH = 1 / 40  # of the width: deviation of the Gaussian with which a point speaks for what is around it
CELLS = 160  # across, on which the points are counted
MIN_SUPPORT = 0.1  # of the weight of one point upon its own cell; further from all points nothing is contradicted
MAX_SHARE = 1 / 3  # of the points around a pixel may be off


def contradicted(depth: np.ndarray, seen: SeenPoints) -> np.ndarray:
    """Pixels around which more than a third of the sparse points are off the map.

    A network's soft edges and wrong regions lie where photos have texture, and so do the points: there the map can be
    checked, and is not needed. Far from all points, on a blank wall, it stays.

    Args:
        depth: (H, W) metres, 0 = invalid.
        seen: the sparse points of this view.

    Returns:
        (H, W) bool.
    """
    height, width = depth.shape
    column, row = seen.column_row
    at = depth[row, column]
    column, row, z, at = (values[at > 0] for values in (column, row, seen.depth, at))
    cell = max(1, width // CELLS)
    counts = np.zeros((2, -(-height // cell), -(-width // cell)))
    off = (np.abs(at / z - 1) > OFF).astype(int)
    np.add.at(counts, (off, row // cell, column // cell), 1.0)
    sigma = REACH * width / cell
    good, bad = (cv2.GaussianBlur(count, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) for count in counts)
    alone = 1 / (2 * np.pi * sigma**2)  # what one point gives its own cell
    doubtful = (bad > MAX_SHARE * (good + bad)) & (good + bad > MIN_SUPPORT * alone)
    return np.repeat(np.repeat(doubtful, cell, axis=0), cell, axis=1)[:height, :width]
