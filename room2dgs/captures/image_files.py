"""Is an image file whole? Asked of every file that a run will use, before the run starts."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from room2dgs.errors import InputError


def color_size(path: Path) -> tuple[int, int]:
    """Decode a photo once and return its size.

    Pillow, because OpenCV fills what is missing from a truncated JPEG with grey and says nothing.

    Returns:
        (width, height) of the pixels as stored; an orientation tag is not applied.

    Raises:
        InputError: missing, truncated or not an image.
    """
    return _decode(path, "a photo")[0]


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
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{path} cannot be decoded as {kind}; replace the file or delete the frame") from error
    return size, mode
