"""Colours of places in the photos that see them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.exposure.gains import Observed

WINDOW = 0.012  # of the photo's width: a place is a patch, since points lie on edges
DARKEST, BRIGHTEST = 12, 247  # levels; what is beyond is clipped, or all noise
LEVEL_NOISE = 1.5  # of a patch's mean
SHIFTED = 0.15  # of a patch's variance: places are not hit exactly, which costs more where colours change


class Sights(NamedTuple):
    """Where one photo sees places.

    Attributes:
        place: (N,) int64, which places.
        pixel: (N, 2) x and y in the photo, pixel centres at +0.5.
    """

    place: np.ndarray
    pixel: np.ndarray


def observed(frames: Sequence[Frame], sights: Sequence[Sights]) -> Observed:
    """Mean colours of the patches around places, each weighted by how sure its logarithm is.

    Args:
        sights: of each frame.

    Raises:
        InputError: a photo cannot be decoded.
    """
    rows = [_of_photo(frame, seen.pixel) for frame, seen in zip(frames, sights, strict=True)]
    view = np.concatenate([np.full(len(seen.place), number) for number, seen in enumerate(sights)])
    place = np.concatenate([seen.place for seen in sights])
    color, weight = (np.concatenate(values) for values in zip(*rows, strict=True))
    return Observed(view.astype(np.int64), place.astype(np.int64), color, weight)


def _of_photo(frame: Frame, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) mean levels of patches, and (N, 3) weights: 0 where a part of the patch is clipped or hidden."""
    if not len(pixel):
        return np.ones((0, 3)), np.zeros((0, 3))
    photo = frame.color()
    height, width = photo.shape[:2]
    column, row = np.clip(np.floor(pixel).astype(int), 0, (width - 1, height - 1)).T
    size = 2 * max(1, round(WINDOW * width / 2)) + 1
    window = np.ones((size, size), np.uint8)
    low, high = cv2.erode(photo, window)[row, column], cv2.dilate(photo, window)[row, column]
    usable = (low > DARKEST) & (high < BRIGHTEST)
    mask = frame.mask()
    if mask is not None:
        usable &= cv2.erode(mask.astype(np.uint8), window)[row, column, None] > 0
    image = photo.astype(np.float32)
    mean = cv2.blur(image, (size, size))[row, column].astype(np.float64)
    square = cv2.sqrBoxFilter(image, cv2.CV_32F, (size, size))[row, column].astype(np.float64)
    variance = LEVEL_NOISE**2 + SHIFTED * np.maximum(square - mean**2, 0)
    mean = np.maximum(mean, 1)
    return mean, np.where(usable, (mean * LEVEL_NOISE / 128) ** 2 / variance, 0)
