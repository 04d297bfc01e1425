"""SIFT features of photos by OpenCV, whose vectors take a third of pycolmap's time; for pycolmap's database."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

# OpenCV's threshold is of three levels of an octave together; at 3 times that of one it finds fewer than COLMAP.
CONTRAST = 2.5
# OpenCV's pixels have their centres at 0, and it takes places in the enlarged photo for twice those in the photo, which
# puts them a quarter of a pixel beside. Its precise enlargement, without that, leads to fewer points of a room.
CENTRE = 0.5 - 0.25
LENGTH = 512  # of a descriptor


class Features(NamedTuple):
    """Of one photo, in a fixed order.

    Attributes:
        keypoints: (F, 4) float32: pixels with centres at +0.5, scale (pixels), orientation (radians).
        descriptors: (F, 128) uint8.
    """

    keypoints: np.ndarray
    descriptors: np.ndarray


def features(rgb: np.ndarray, usable: np.ndarray | None, at_most: int, peak_threshold: float) -> Features:
    """SIFT (Lowe 2004) with RootSIFT's descriptors (Arandjelovic and Zisserman 2012).

    Args:
        rgb: (H, W, 3) uint8.
        usable: (H, W) bool, pixels that features may lie on; None: all.
        at_most: the strongest are kept.
        peak_threshold: of the difference of Gaussians, of images in 0..1.
    """
    sift = cv2.SIFT_create(nfeatures=at_most, contrastThreshold=CONTRAST * peak_threshold, enable_precise_upscale=False)
    mask = None if usable is None else usable.astype(np.uint8)
    points, found = sift.detectAndCompute(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), mask)
    if not points:
        return Features(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))
    rows = [(p.pt[0] + CENTRE, p.pt[1] + CENTRE, p.size / 2, np.radians(p.angle)) for p in points]
    shares = found / np.maximum(found.sum(axis=1, keepdims=True), 1)
    return Features(np.array(rows, np.float32), np.round(LENGTH * np.sqrt(shares)).clip(0, 255).astype(np.uint8))
