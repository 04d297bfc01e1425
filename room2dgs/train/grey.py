"""Grey photos, and where they have something to hold on to."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor

LUMA = np.array([0.299, 0.587, 0.114], np.float32) / 255


class GreyPhoto(NamedTuple):
    """A photo's brightness.

    Attributes:
        grey: (H, W) float32 in 0..1.
        textured: (H, W) bool: the patch around the pixel is inside the image and not flat.
    """

    grey: Tensor
    textured: Tensor


def grey_photo(image: Tensor, patch: int, min_std: float, mask: Tensor | None = None) -> GreyPhoto:
    """Brightness of a photo, and the pixels whose patches have a standard deviation of `min_std` or more.

    Args:
        image: (H, W, 3) uint8 RGB.
        patch: side of a patch, pixels.
        min_std: in grey levels of 0..1.
        mask: (H, W) bool; patches with a pixel that it hides count as flat, and what it hides is black.
    """
    grey = image.numpy() @ LUMA
    if mask is not None:  # sums and interpolation round: what is hidden is not to show in their last bits
        grey = np.where(mask.numpy(), grey, np.zeros_like(grey))
    mean, square = (cv2.blur(values, (patch, patch)) for values in (grey, grey * grey))
    textured = np.zeros(grey.shape, bool)
    inner = (slice(patch // 2, -(patch // 2)),) * 2
    textured[inner] = (square - mean * mean)[inner] >= min_std**2
    if mask is not None:
        textured &= cv2.erode(mask.numpy().astype(np.uint8), np.ones((patch, patch), np.uint8)) > 0
    return GreyPhoto(torch.from_numpy(grey), torch.from_numpy(textured))
