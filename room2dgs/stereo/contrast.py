"""Where depth of wide windows is believed less: beside the edges of things.

Wide windows find blank walls by a few grey levels. Where the photo has contrast they reach across the edges of things,
and a narrow window that finds nothing there has a reason.
"""

from __future__ import annotations

import cv2
import numpy as np

BESIDE_PX = 8  # how far wide windows of photos of 160 pixels reach, pixels of the first pass's photo
HALF = 20.0  # grey levels between the darkest and the brightest of them at which half of the consistent views count


def discounted_by_contrast(num_consistent: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """How many of the views count that are consistent with depth of wide windows.

    Args:
        num_consistent: (H, W) uint8.
        photo: (H, W) uint8, grey.

    Returns:
        (H, W) uint8, at most `num_consistent`.
    """
    smooth = cv2.blur(photo, (3, 3))  # noise has contrast, too
    kernel = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), np.uint8)
    contrast = cv2.dilate(smooth, kernel).astype(np.float32) - cv2.erode(smooth, kernel)
    return np.rint(num_consistent / (1 + (contrast / HALF) ** 2)).astype(np.uint8)
