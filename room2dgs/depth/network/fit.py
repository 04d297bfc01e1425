"""A photo on its way into a network's input, and the way back for what comes out."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.depth.network.card import NetworkFormat
from room2dgs.geometry.camera import Camera

# ImageNet's mean colour, RGB: what fills the rest of a padded input
FILL = (123.675, 116.28, 103.53)


class Fit(NamedTuple):
    """Where the photo lies in the network's input.

    Attributes:
        height, width: of the input.
        top, left, inner_height, inner_width: the photo in it.
    """

    height: int
    width: int
    top: int
    left: int
    inner_height: int
    inner_width: int


def fitted(camera: Camera, height: int, width: int, how: str, multiple: int = 1) -> Fit:
    """How a photo goes into an input of about height x width.

    Args:
        camera: the photo's; its size alone matters.
        how: "stretch" to that very size; "pad": as large as fits into it, centred; "cover": the input is the
            smallest with the photo's aspect that is no smaller, its sides rounded to multiples.
        multiple: for "cover".
    """
    if how == "stretch":
        return Fit(height, width, 0, 0, height, width)
    ratios = (height / camera.height, width / camera.width)
    if how == "cover":
        high, wide = (max(1, round(side * max(ratios) / multiple)) * multiple for side in (camera.height, camera.width))
        return Fit(high, wide, 0, 0, high, wide)
    high, wide = (
        max(1, min(limit, int(side * min(ratios) + 0.5)))
        for side, limit in ((camera.height, height), (camera.width, width))
    )
    return Fit(height, width, (height - high) // 2, (width - wide) // 2, high, wide)


def network_input(photo: np.ndarray, fit: Fit, settings: NetworkFormat) -> np.ndarray:
    """A photo as the network reads it.

    Args:
        photo: (H, W, 3) uint8 RGB.

    Returns:
        (1, 3, h, w) or (1, h, w, 3) float32, by `layout`.
    """
    size = (fit.inner_width, fit.inner_height)
    shrinks = size[0] < photo.shape[1]
    inner = cv2.resize(photo, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    whole: np.ndarray = np.empty((fit.height, fit.width, 3), np.float32)
    whole[:] = FILL
    whole[fit.top : fit.top + fit.inner_height, fit.left : fit.left + fit.inner_width] = inner
    whole *= settings.white / 255.0
    if settings.channels == "bgr":
        whole = whole[..., ::-1]
    whole = (whole - np.array(settings.mean, np.float32)) / np.array(settings.std, np.float32)
    return np.ascontiguousarray(whole.transpose(2, 0, 1) if settings.layout == "nchw" else whole)[None]


def input_intrinsics(camera: Camera, fit: Fit) -> np.ndarray:
    """(3, 3) float64 intrinsics of the photo in the input's pixels."""
    K = camera.resized(fit.inner_width, fit.inner_height).K.copy()
    K[:2, 2] += fit.left, fit.top
    return K


def photo_part(values: np.ndarray, fit: Fit) -> np.ndarray:
    """What belongs to the photo in an output.

    Args:
        values: (h, w, ...) of the input's shape, at any scale.
    """
    down, across = values.shape[0] / fit.height, values.shape[1] / fit.width
    top, left = round(fit.top * down), round(fit.left * across)
    bottom, right = round((fit.top + fit.inner_height) * down), round((fit.left + fit.inner_width) * across)
    return values[top : max(bottom, top + 1), left : max(right, left + 1)]
