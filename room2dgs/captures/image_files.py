"""Decodes image files and checks that they are complete.

Pillow, because OpenCV fills what is missing from a truncated JPEG with grey and says nothing.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.opened_images import MEND, MOST_DEPTH_PIXELS, opened_image
from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular

MASK_WHOLE = 1 - 1e-4  # share of a pixel that must be usable; resizing rounds


def color_size(path: Path | BytesIO, label: object = None) -> tuple[int, int]:
    """A photo's size, by its header.

    Args:
        label: what messages call it; None: its path.

    Returns:
        (width, height) of the pixels as stored; an orientation tag is not applied.

    Raises:
        InputError: missing or not an image.
    """
    with opened_image(path, label) as image:
        return image.size


def read_photo(path: Path | BytesIO, size: tuple[int, int] | None, label: object = None) -> np.ndarray:
    """Decode a photo and area-average it down to a size.

    Args:
        size: (width, height); None: as it is.

    Returns:
        (H, W, 3) uint8 RGB; an orientation tag is not applied.

    Raises:
        InputError: missing, truncated or not an image.
    """
    with opened_image(path, label) as image:
        image.load()
        if not image.mode.startswith(("I", "F")):
            return resized(np.array(image if image.mode == "RGB" else image.convert("RGB")), size)
    return resized(_deep(path, label or path), size)


def _deep(path: Path | BytesIO, label: object) -> np.ndarray:
    """(H, W, 3) of a photo with more than 8 bits a channel, which Pillow would clip; it was opened before."""
    if isinstance(path, BytesIO):
        data = path.getvalue()
    else:
        with open_regular(path) as file:
            data = file.read()
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise InputError(f"{label} cannot be decoded as a photo; {MEND}")
    return cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)


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
    with opened_image(path, label) as image:
        # A JPEG is read to its end but transformed at an eighth of its size, which is faster.
        image.draft(None, (1, 1))
        image.load()


def depth_size(path: Path) -> tuple[int, int] | None:
    """A depth map's size, by its header.

    Returns:
        (width, height); None for a damaged file: a run can do without one photo's depth, whoever reads it tells.

    Raises:
        InputError: not 16 bits in one channel.
    """
    try:
        with opened_image(path, most=MOST_DEPTH_PIXELS) as image:
            size, mode = image.size, image.mode
    except InputError:
        return None
    if not mode.startswith("I"):
        raise InputError(f"{path} is not a 16-bit one-channel PNG; write depth in millimetres, 0 = invalid")
    return size


def read_numbers(path: Path | BytesIO, label: object = None) -> np.ndarray:
    """A map of numbers in one channel of 16 or 32 bits, as they are stored.

    Returns:
        (H, W) uint16, int32 or float32.

    Raises:
        InputError: missing, truncated, no image, more pixels than a map may have, or 8 bits or several channels.
    """
    label = label or path
    with opened_image(path, label, MOST_DEPTH_PIXELS) as image:
        if not image.mode.startswith(("I", "F")):
            raise InputError(f"{label} cannot be decoded as a one-channel depth map of 16 bits; replace it")
        image.load()
        numbers = np.array(image)
    return numbers.astype(numbers.dtype.newbyteorder("="), copy=False)
