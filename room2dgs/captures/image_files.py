"""Image files: photos decoded, and asked whether they are whole, all of them before a run starts.

Pillow, because OpenCV fills what is missing from a truncated JPEG with grey and says nothing.
"""

from __future__ import annotations

import struct
import zlib
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from room2dgs.errors import InputError

MASK_WHOLE = 1 - 1e-4  # share of a pixel that must be usable; resizing rounds
# each of Pillow's decoders fails its own way
DAMAGE = (
    OSError, SyntaxError, ValueError, EOFError, TypeError, LookupError, ArithmeticError, MemoryError, struct.error,
    zlib.error, Image.DecompressionBombError,
)  # fmt: skip


def color_size(path: Path | BytesIO, label: object = None) -> tuple[int, int]:
    """A photo's size, by its header.

    Args:
        label: what messages call it; None: its path.

    Returns:
        (width, height) of the pixels as stored; an orientation tag is not applied.

    Raises:
        InputError: missing or not an image.
    """
    try:
        with Image.open(path) as image:
            return image.size
    except DAMAGE as error:
        raise _refusal(label or path, "a photo") from error


def read_photo(path: Path | BytesIO, size: tuple[int, int] | None, label: object = None) -> np.ndarray:
    """Decode a photo and area-average it down to a size.

    Args:
        size: (width, height); None: as it is.

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
    except DAMAGE as error:
        raise _refusal(label or path, "a photo") from error
    if pixels is None:
        data = path.read_bytes() if isinstance(path, Path) else path.getvalue()
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        if pixels is None:
            raise _refusal(label or path, "a photo")
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)
    return resized(pixels, size)


def resized(pixels: np.ndarray, size: tuple[int, int] | None) -> np.ndarray:
    """An image area-averaged to (width, height); None: as it is."""
    if size is None or pixels.shape[1::-1] == size:
        return pixels
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)


def whole_at(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(height, width) bool: pixels of an image of `size` of which a mask (usable: 1) hides no part."""
    return resized(mask.astype(np.float32), size) > MASK_WHOLE


def check_photo(path: Path | BytesIO, label: object = None) -> None:
    """Read a photo to its end without keeping it.

    Raises:
        InputError: missing, truncated or not an image.
    """
    try:
        with Image.open(path) as image:
            # A JPEG is read to its end but transformed at an eighth of its size, which is faster.
            image.draft(None, (1, 1))
            image.load()
    except DAMAGE as error:
        raise _refusal(label or path, "a photo") from error


def depth_size(path: Path) -> tuple[int, int] | None:
    """A depth map's size, by its header.

    Returns:
        (width, height); None for a damaged file: a run can do without one photo's depth, whoever reads it tells.

    Raises:
        InputError: not 16 bits in one channel.
    """
    try:
        with Image.open(path) as image:
            size, mode = image.size, image.mode
    except DAMAGE:
        return None
    if not mode.startswith("I"):
        raise InputError(f"{path} is not a 16-bit one-channel PNG; write depth in millimetres, 0 = invalid")
    return size


def _refusal(path: object, kind: str) -> InputError:
    return InputError(f"{path} cannot be decoded as {kind}; replace the file or delete the frame")
