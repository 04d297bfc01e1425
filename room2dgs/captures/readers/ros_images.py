"""Pictures and depth in messages of ROS, and what CameraInfo says of their cameras."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import cv2
import numpy as np

from room2dgs.captures.image_files import read_numbers, resized
from room2dgs.captures.lens import Lens
from room2dgs.errors import InputError

MAX_SIDE = 1 << 15
# encoding -> channels, bytes of each, and OpenCV's way to RGB
COLOURS = {
    "rgb8": (3, 1, None),
    "bgr8": (3, 1, cv2.COLOR_BGR2RGB),
    "8UC3": (3, 1, cv2.COLOR_BGR2RGB),
    "rgba8": (4, 1, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, 1, cv2.COLOR_BGRA2RGB),
    "8UC4": (4, 1, cv2.COLOR_BGRA2RGB),
    "mono8": (1, 1, cv2.COLOR_GRAY2RGB),
    "8UC1": (1, 1, cv2.COLOR_GRAY2RGB),
    "mono16": (1, 2, cv2.COLOR_GRAY2RGB),
    "rgb16": (3, 2, None),
    "bgr16": (3, 2, cv2.COLOR_BGR2RGB),
    "bayer_rggb8": (1, 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": (1, 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": (1, 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": (1, 1, cv2.COLOR_BayerGRBG2RGB),
    "yuv422": (2, 1, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (2, 1, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": (2, 1, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": (2, 1, cv2.COLOR_YUV2RGB_YUY2),
}
# encoding -> type and metres of one unit (REP 118)
DEPTHS = {"16UC1": (np.uint16, 0.001), "mono16": (np.uint16, 0.001), "32FC1": (np.float32, 1.0)}
DEPTH_HEADER = struct.Struct("<i2f")  # of compressedDepth: format, A and B of depth = A / (number - B)


@dataclass(frozen=True)
class RawPhoto:
    """A picture that is not packed.

    Attributes:
        label: what messages call it.
        shape: (width, height).
        message: reads it anew each time.
    """

    label: str
    shape: tuple[int, int]
    message: Callable[[], Any] = field(compare=False)

    def size(self) -> tuple[int, int]:
        return self.shape

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        message = self.message()
        channels, depth, code = COLOURS[colour_encoding(message, self.label)]
        image = _array(message, np.uint8 if depth == 1 else np.uint16, channels, self.label)
        image = image if depth == 1 else (image >> 8).astype(np.uint8)
        image = np.ascontiguousarray(image if channels > 1 else image[..., 0])
        return resized(image if code is None else cv2.cvtColor(image, code), size)

    def check(self) -> None:
        self.pixels()

    def digest(self) -> bytes:
        return hashlib.sha256(self.pixels().tobytes()).digest()


def colour_encoding(message: Any, label: str) -> str:
    """The picture's encoding.

    Raises:
        InputError: it is not read.
    """
    if message.encoding not in COLOURS:
        raise InputError(
            f"{label} has pictures encoded as {message.encoding[:40]!r}, which is not read; record rgb8, bgr8 or a "
            "compressed topic"
        )
    return message.encoding


def photo_size(message: Any, label: str) -> tuple[int, int]:
    """(width, height) of a picture that is not packed.

    Raises:
        InputError: it cannot be.
    """
    if not (0 < message.width < MAX_SIDE and 0 < message.height < MAX_SIDE):
        raise InputError(f"{label} has a picture of {message.width}x{message.height} pixels; record it again")
    return message.width, message.height


def _array(message: Any, kind: type, channels: int, label: str) -> np.ndarray:
    """(H, W, C) of a sensor_msgs/Image, whose rows may be longer than its pixels."""
    width, height = photo_size(message, label)
    row = width * channels * np.dtype(kind).itemsize
    data = np.asarray(message.data, np.uint8)
    if message.step < row or len(data) < (height - 1) * message.step + row:
        raise InputError(f"{label} has fewer bytes than its {width}x{height} pixels; record it again")
    step = message.step
    rows = np.lib.stride_tricks.as_strided(data, (height, row), (step, 1), writeable=False)
    stored = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    image: np.ndarray = np.ascontiguousarray(rows).view(stored).astype(kind)
    return image.reshape(height, width, channels)


def depth_encoding(topic: str, message: Any) -> str | None:
    """16UC1 or 32FC1 if a topic has depth, None if it has pictures."""
    if hasattr(message, "encoding"):
        kind = message.encoding
        return kind if kind in ("16UC1", "32FC1") or (kind == "mono16" and "depth" in topic) else None
    kind = message.format.partition(";")[0].strip()
    if kind in ("16UC1", "32FC1"):
        return kind
    return "16UC1" if "compressedDepth" in message.format or topic.endswith("/compressedDepth") else None


def depth_numbers(message: Any, encoding: str, label: str) -> np.ndarray:
    """(H, W) in the unit of its encoding.

    Raises:
        InputError: it cannot be decoded.
    """
    kind, _ = DEPTHS[encoding]
    if hasattr(message, "encoding"):
        if message.encoding != encoding:
            raise InputError(f"{label} is encoded as {message.encoding[:40]!r}, others as {encoding}; record it again")
        return _array(message, kind, 1, label)[..., 0]
    data = np.asarray(message.data, np.uint8)
    scale = None
    if "compressedDepth" in message.format or label.endswith("compressedDepth"):
        if "rvl" in message.format.lower() or len(data) < DEPTH_HEADER.size:
            raise InputError(f"{label} is packed by RVL or damaged; record depth as PNG or not compressed")
        _, a, b = DEPTH_HEADER.unpack(data[: DEPTH_HEADER.size].tobytes())
        data, scale = data[DEPTH_HEADER.size :], (a, b)
    image = read_numbers(BytesIO(data.tobytes()), label)
    if encoding == "32FC1":
        if scale is None:
            raise InputError(f"{label} has depth in metres as a PNG without its scale; record it again")
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(image > 0, np.float32(scale[0]) / (image.astype(np.float32) - np.float32(scale[1])), 0.0)
    return image


def lens_of(info: Any, rectified: bool, half: bool, label: str) -> Lens | None:
    """What CameraInfo says of a topic's pictures; None if it is not calibrated.

    Args:
        rectified: the pictures are undistorted already: P holds for them, and no distortion.
        half: cx, cy count pixel centres at +0.5; False: at integers, as ROS has it.

    Raises:
        InputError: it is no camera that is read.
    """
    K = np.asarray(getattr(info, "k", None) if hasattr(info, "k") else info.K, np.float64).reshape(3, 3)
    P = np.asarray(getattr(info, "p", None) if hasattr(info, "p") else info.P, np.float64).reshape(3, 4)
    D = [float(value) for value in (info.d if hasattr(info, "d") else info.D)]
    K = P[:, :3] if rectified and P[0, 0] != 0 else K
    if K[0, 0] == 0:
        return None
    shift = 0.0 if half else 0.5
    roi, binning = info.roi, (max(1, info.binning_x), max(1, info.binning_y))
    size = np.array((roi.width, roi.height) if roi.width and roi.height else (info.width, info.height))
    focal = K[(0, 1), (0, 1)] / binning
    centre = (K[:2, 2] + shift - (roi.x_offset, roi.y_offset)) / binning
    shape = int(size[0]) // binning[0], int(size[1]) // binning[1]
    params = tuple(float(value) for value in (*focal, *centre))
    known = shape if min(shape) > 0 else None
    if rectified or not any(D):
        lens = Lens("PINHOLE", params, known, label)
    elif info.distortion_model in ("equidistant", "fisheye") and len(D) >= 4:
        lens = Lens("OPENCV_FISHEYE", (*params, *D[:4]), known, label)
    elif info.distortion_model in ("plumb_bob", "rational_polynomial", "") and len(D) >= 4 and not any(D[8:]):
        lens = Lens("FULL_OPENCV", (*params, *(*D, *[0.0] * 8)[:8]), known, label)
    else:
        raise InputError(
            f"{label} has a distortion {info.distortion_model[:40]!r} of {len(D)} numbers, which is not read; record "
            "the rectified pictures"
        )
    lens.check()
    return lens


def registered(depth_m: np.ndarray, K: np.ndarray, color_from_depth: np.ndarray) -> np.ndarray:
    """Depth as a camera like the sensor would see it from the photo's place.

    Args:
        depth_m: (H, W) metres, 0 or not finite = unknown.
        K: (3, 3) of the sensor, pixel centres at +0.5.
        color_from_depth: (4, 4).

    Returns:
        (H, W) float32: the nearest surface at each pixel, 0 = unknown.
    """
    height, width = depth_m.shape
    row, column = np.nonzero(np.isfinite(depth_m) & (depth_m > 0))
    z = depth_m[row, column].astype(np.float64)
    rays = np.stack([(column + 0.5 - K[0, 2]) / K[0, 0], (row + 0.5 - K[1, 2]) / K[1, 1], np.ones(len(z))], axis=1)
    at = (rays * z[:, None]) @ color_from_depth[:3, :3].T + color_from_depth[:3, 3]
    at = at[at[:, 2] > 1e-3]
    pixel = np.floor(at[:, :2] / at[:, 2:] * (K[0, 0], K[1, 1]) + (K[0, 2], K[1, 2])).astype(np.int64)
    inside = ((pixel >= 0) & (pixel < (width, height))).all(axis=1)
    result = np.full((height, width), np.inf)
    np.minimum.at(result, (pixel[inside, 1], pixel[inside, 0]), at[inside, 2])
    return np.where(np.isfinite(result), result, 0.0).astype(np.float32)
