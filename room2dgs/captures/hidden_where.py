"""Inverted masks, which are white where a photo may not be used, as instant-ngp has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.captures.photos import PhotoFile


@dataclass(frozen=True)
class HiddenWhere(PhotoFile):
    """An image file that hides where any of its channels is not black; read the way other masks are."""

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        """(H, W, 3) uint8, 255 where the photo may be used."""
        shown = (super().pixels(size) == 0).all(axis=-1, keepdims=True)
        return np.where(shown, np.uint8(255), np.uint8(0)).repeat(3, axis=-1)

    def digest(self) -> bytes:
        return b"hidden where " + super().digest()
