"""Where what wide windows found can be believed.

Wide windows tell walls by a few grey levels; where the photo has contrast they reach across the edges of things, and a
narrow window that finds nothing has a reason.
"""

from __future__ import annotations

import cv2
import numpy as np

BESIDE_PX = 8  # how far wide windows of photos of 160 pixels reach, pixels of the first look's photo
HALF = 20.0  # grey levels between the darkest and the brightest of them at which half of the views that agree count


def believed(agreeing: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """How many views count that agree with depth of wide windows.

    Args:
        agreeing: (H, W) uint8.
        photo: (H, W) uint8, grey.

    Returns:
        (H, W) uint8, at most `agreeing`.
    """
    smooth = cv2.blur(photo, (3, 3))  # noise has contrast, too
    kernel = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), np.uint8)
    contrast = cv2.dilate(smooth, kernel).astype(np.float32) - cv2.erode(smooth, kernel)
    return np.rint(agreeing / (1 + (contrast / HALF) ** 2)).astype(np.uint8)
