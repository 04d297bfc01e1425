"""How sharp a picture is."""

from __future__ import annotations

import cv2
import numpy as np

REBLUR = 9  # pixels of the box; Crete et al. 2007
SIDE = 1280
GRAIN = 1.0  # pixels of a blur that comes first: noise of the sensor, which no motion blurs, must not count


def sharpness(grey: np.ndarray) -> float:
    """0 (blurred) .. 1 (sharp): what a further blur takes from the differences of neighbours (Crete et al., "The blur
    effect: perception and estimation with a new no-reference perceptual blur metric", 2007), in the worse direction.

    A picture that is sharp loses much of them, a blurred one little; contrast does not matter.

    Args:
        grey: (H, W) uint8.
    """
    scale = SIDE / max(grey.shape)
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), GRAIN)
    lost = []
    for axis, size in ((1, (REBLUR, 1)), (0, (1, REBLUR))):
        before = np.abs(np.diff(image, axis=axis))
        after = np.abs(np.diff(cv2.blur(image, size), axis=axis))
        total = float(before.sum(dtype=np.float64))
        lost.append(float(np.maximum(before - after, 0).sum(dtype=np.float64)) / total if total else 0.0)
    return min(lost)
