"""Depth in OpenEXR files, which neither Pillow nor OpenCV's wheels read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.opened_images import MOST_DEPTH_PIXELS, begins
from room2dgs.errors import InputError, first_line
from room2dgs.regular_files import open_regular

MAGIC = b"\x76\x2f\x31\x01"
CHANNELS = ("R", "Y", "Z", "depth", "Depth", "D", "V")  # the first that is there
SIDE = 1 << 20
MEND = "replace it or export the capture again"
# by bytes of a number
_FLOATS: dict[int, np.dtype[Any]] = {2: np.dtype("<f2"), 4: np.dtype("<f4")}


def exr_size(path: Path) -> tuple[int, int]:
    """(width, height) by the header.

    Raises:
        InputError: as `read_exr`.
    """
    return _opened(path)[1]


def read_exr(path: Path) -> np.ndarray:
    """Numbers of the one channel that stands for depth.

    Returns:
        (H, W) float32, halves too; what lies outside of the file's data window is 0.

    Raises:
        InputError: missing, no OpenEXR file, damaged, too large, without such a channel, or the package is missing.
    """
    file, (width, height) = _opened(path)
    header = file.header()
    name = _channel(header, path)
    data, shown = header["dataWindow"], header["displayWindow"]
    try:
        numbers = file.channel(name)
    except Exception as error:  # whatever its C++ code raises
        raise InputError(f"{path} cannot be decoded as a depth map ({first_line(error)[:80]}); {MEND}") from error
    box = data.max.y - data.min.y + 1, data.max.x - data.min.x + 1
    kind = _FLOATS.get(len(numbers) // (box[0] * box[1]))
    if kind is None or str(header["channels"][name].type) == "UINT":
        raise InputError(f"{path} has a channel {name} that holds no floats of its size; {MEND}")
    values = np.frombuffer(numbers, kind).reshape(box).astype(np.float32)
    if box == (height, width):
        return values
    whole = np.zeros((height, width), np.float32)
    top, left = data.min.y - shown.min.y, data.min.x - shown.min.x
    inner = values[max(0, -top) : max(0, height - top), max(0, -left) : max(0, width - left)]
    top, left = max(0, top), max(0, left)
    whole[top : top + inner.shape[0], left : left + inner.shape[1]] = inner
    return whole


def _opened(path: Path) -> tuple[Any, tuple[int, int]]:
    """The file, of which the header is read, and its (width, height)."""
    with open_regular(path) as file:
        head = file.read(16)
    if not head:
        raise InputError(f"{path} is empty (0 bytes); {MEND}")
    if not head.startswith(MAGIC):
        raise InputError(f"{path} is no OpenEXR file (it begins {begins(head)}); {MEND}")
    try:
        import OpenEXR
    except ImportError as error:
        raise InputError(f"{path} is an OpenEXR file; install OpenEXR (pip install OpenEXR) to read it") from error
    try:
        file = OpenEXR.InputFile(str(path))
        header = file.header()
        boxes = [header[name] for name in ("dataWindow", "displayWindow")]
    except Exception as error:  # whatever its C++ code raises
        raise InputError(f"{path} cannot be decoded as a depth map ({first_line(error)[:80]}); {MEND}") from error
    sizes = [(box.max.x - box.min.x + 1, box.max.y - box.min.y + 1) for box in boxes]
    for width, height in sizes:
        if not (0 < width < SIDE and 0 < height < SIDE and width * height <= MOST_DEPTH_PIXELS):
            raise InputError(
                f"{path} has {width}x{height} pixels, and {MOST_DEPTH_PIXELS >> 20} million are read at most; {MEND}"
            )
    return file, sizes[1]


def _channel(header: dict[str, Any], path: Path) -> str:
    channels = header["channels"]
    name = next((name for name in CHANNELS if name in channels), None)
    if name is None and len(channels) == 1:
        name = next(iter(channels))
    if name is None:
        names = ", ".join(sorted(map(str, channels))[:8])
        raise InputError(f"{path} has channels {names}, none of them depth ({', '.join(CHANNELS)}); {MEND}")
    return name
