"""Image files: photos decoded, and asked whether they are whole, all of them before a run starts.

Pillow, because OpenCV fills what is missing from a truncated JPEG with grey and says nothing.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from room2dgs.errors import InputError

_DAMAGE = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)


def color_size(path: Path) -> tuple[int, int]:
    """A photo's size, by its header.

    Returns:
        (width, height) of the pixels as stored; an orientation tag is not applied.

    Raises:
        InputError: missing or not an image.
    """
    try:
        with Image.open(path) as image:
            return image.size
    except _DAMAGE as error:
        raise _refusal(path, "a photo") from error


def read_photo(path: Path, size: tuple[int, int]) -> np.ndarray:
    """Decode a photo and area-average it down to a size.

    Args:
        size: (width, height).

    Returns:
        (H, W, 3) uint8 RGB; an orientation tag is not applied.

    Raises:
        InputError: missing, truncated or not an image.
    """
    try:
        with Image.open(path) as image:
            image.load()
            deep = image.mode.startswith(("I", "F"))  # Pillow clips 16 bits to 8
            pixels = None if deep else np.array(image if image.mode == "RGB" else image.convert("RGB"))
    except _DAMAGE as error:
        raise _refusal(path, "a photo") from error
    if pixels is None:
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        if pixels is None:
            raise _refusal(path, "a photo")
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)
    return pixels if pixels.shape[1::-1] == size else cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)


def check_photo(path: Path) -> None:
    """Read a photo to its end without keeping it.

    Raises:
        InputError: missing, truncated or not an image.
    """
    _decode(path, "a photo")


def depth_size(path: Path) -> tuple[int, int]:
    """Decode a depth map once and return its size.

    Returns:
        (width, height).

    Raises:
        InputError: missing, truncated, not an image or not 16 bits in one channel.
    """
    size, mode = _decode(path, "a depth map")
    if not mode.startswith("I"):
        raise InputError(f"{path} is not a 16-bit one-channel PNG; write depth in millimetres, 0 = invalid")
    return size


def _decode(path: Path, kind: str) -> tuple[tuple[int, int], str]:
    try:
        with Image.open(path) as image:
            size, mode = image.size, image.mode
            # A JPEG is read to its end but transformed at an eighth of its size, which is faster.
            image.draft(None, (1, 1))
            image.load()
    except _DAMAGE as error:
        raise _refusal(path, kind) from error
    return size, mode


def _refusal(path: Path, kind: str) -> InputError:
    return InputError(f"{path} cannot be decoded as {kind}; replace the file or delete the frame")
