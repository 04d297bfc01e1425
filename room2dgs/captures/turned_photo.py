"""Photos rotated by their EXIF orientation, where the intrinsics are for the rotated photo."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from room2dgs.captures.image_files import resized
from room2dgs.captures.photos import Photo

ON_ITS_SIDE = 5  # orientations from here on swap width and height


@dataclass(frozen=True)
class TurnedPhoto:
    """A photo as a viewer of pictures shows it.

    Attributes:
        photo: as stored.
        orientation: 2..8 of EXIF.
    """

    photo: Photo
    orientation: int

    def size(self) -> tuple[int, int]:
        return turned_size(self.photo.size(), self.orientation)

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        return resized(turned(self.photo.pixels(), self.orientation), size)

    def check(self) -> None:
        self.photo.check()

    def digest(self) -> bytes:
        return hashlib.sha256(self.photo.digest() + bytes([self.orientation])).digest()


def turned_size(size: tuple[int, int], orientation: int) -> tuple[int, int]:
    """(width, height) after the turn."""
    return size[::-1] if orientation >= ON_ITS_SIDE else size


def turned(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """(H, W) or (H, W, C) as stored -> upright, by EXIF's orientation 1..8."""
    if orientation >= ON_ITS_SIDE:
        pixels = np.swapaxes(pixels, 0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels)
