"""ScanNet's .sens: one file with poses, JPEG photos and compressed depth, which is never in memory as a whole.

Little endian, version 4 (`SensorData.py`, `sensorData.h` of ScanNet). Poses are camera-to-world with OpenCV axes,
cx, cy count pixel centres at integers.
"""

from __future__ import annotations

import math
import struct
import zlib
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.captures.capture import Capture, Lost, Shot, pinhole_lens
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.listing import Listing
from room2dgs.captures.matrix_files import rigid
from room2dgs.captures.photos import PhotoBytes
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.scannet import not_registered, scannet_mesh
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.regular_files import check_regular, open_regular

LAYOUT = "<scan>.sens"
MEND = "download it again"
VERSION = 4
JPEG_OR_PNG = (1, 2)
RAW_U16, ZLIB_U16 = 0, 1
FRAME_HEADER = struct.Struct("<16f4Q")
MAX_NAME, MAX_SIDE = 4096, 1 << 15
# Bytes of a pixel that no JPEG, PNG or zlib of noise needs, and what their headers may take.
MOST_PER_PIXEL, MOST_BESIDE = 16, 1 << 20


class _Header(NamedTuple):
    K_color: np.ndarray
    K_depth: np.ndarray
    extrinsics: tuple[np.ndarray, np.ndarray]
    color_compression: int
    depth_compression: int
    color: tuple[int, int]
    depth: tuple[int, int]
    shift: float
    frames: int


class _Place(NamedTuple):
    """Where a frame's photo and depth lie in the file: first byte and number of bytes."""

    color: tuple[int, int]
    depth: tuple[int, int]
    pose: np.ndarray


def is_sens(files: Listing) -> bool:
    """A file that ends so, in the folder or itself."""
    return bool(files.with_suffix((".sens",)))


def read_sens(root: Path, config: SceneConfig) -> Capture:
    """Read a .sens: its frames' headers now, photos and depth when they are asked for.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = the_file(root, ".sens")
    header, places = _scanned(path)
    half = config.pixel_centres == "half"
    lens = _lens(header.K_color, header.color, path, half)
    K = _lens(header.K_depth, header.depth, path, half).K
    K_depth = tuple(map(tuple, K))
    folder = path.parent / path.stem
    shots = [
        Shot(
            f"{index:06d}",
            folder / f"{index:06d}.jpg",
            partial(_pose, place, path, index),
            lens,
            PhotoBytes(f"{path} frame {index}", partial(_bytes_at, path, *place.color)),
            DepthMap(
                f"{path} (depth of frame {index})",
                partial(_depth, path, place.depth, header, index),
                1.0 / header.shift,
                K_depth,
            )
            if place.depth[1]
            else None,
        )
        for index, place in enumerate(places)
    ]
    gt_mesh = scannet_mesh(path.parent) if root.is_dir() else path.with_name(f"{path.stem}_vh_clean_2.ply")
    gt_mesh = gt_mesh if gt_mesh and gt_mesh.is_file() else None
    return Capture(
        root,
        "sens",
        shots,
        gt_mesh=gt_mesh,
        why="ScanNet's poses are metres",
        warnings=not_registered(*header.extrinsics, path) if any(place.depth[1] for place in places) else [],
    )


def the_file(root: Path, suffix: str) -> Path:
    """The one file with a suffix: itself, or in a folder.

    Raises:
        InputError: none or several.
    """
    found = [root] if root.is_file() else [root / name for name in Listing(root).with_suffix((suffix,))]
    if len(found) != 1:
        raise InputError(f"{root} has {len(found)} files {suffix}; give scene.path=FILE of one")
    return found[0]


def _pose(place: _Place, path: Path, index: int) -> np.ndarray:
    matrix = place.pose
    if not place.color[1]:
        raise Lost(f"{path.name} frame {index} has no photo")
    if not np.isfinite(matrix).all():
        raise Lost(f"{path.name} frame {index} holds inf or NaN (tracking lost)")
    return rigid(matrix, f"{path} frame {index}")


def _lens(K: np.ndarray, size: tuple[int, int], path: Path, half: bool):
    return pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, path, half)


def _scanned(path: Path) -> tuple[_Header, list[_Place]]:
    size = check_regular(path, MEND)
    try:
        with open_regular(path, MEND) as file:
            header = _header(file, path)
            if header.frames * FRAME_HEADER.size > size - file.tell():
                raise _damaged(path, f"it announces {header.frames} frames and has no room for them")
            places = []
            for index in range(header.frames):
                *numbers, _, _, color, depth = FRAME_HEADER.unpack(_read(file, FRAME_HEADER.size, path))
                start = file.tell()
                if color + depth > size - start:
                    raise _damaged(path, f"it ends in frame {index} of {header.frames}")
                for part, (width, height) in ((color, header.color), (depth, header.depth)):
                    if part > MOST_PER_PIXEL * width * height + MOST_BESIDE:
                        raise _damaged(path, f"frame {index} has {part} bytes for {width}x{height} pixels")
                pose = np.array(numbers, np.float64).reshape(4, 4)
                places.append(_Place((start, color), (start + color, depth), pose))
                file.seek(start + color + depth)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the file") from error
    return header, places


def _header(file, path: Path) -> _Header:
    version, length = struct.unpack("<IQ", _read(file, 12, path))
    if version != VERSION:
        raise InputError(f"{path} is no .sens of version {VERSION} (it says {version}); download it again")
    if length > MAX_NAME:
        raise _damaged(path, f"its sensor's name has {length} letters")
    _read(file, length, path)
    matrices = np.frombuffer(_read(file, 4 * 64, path), "<f4").astype(np.float64).reshape(4, 4, 4)
    color_code, depth_code, *sizes, shift, frames = struct.unpack("<ii4IfQ", _read(file, 36, path))
    if color_code not in JPEG_OR_PNG:
        raise InputError(f"{path} has photos of compression {color_code}, which is not read; JPEG and PNG are")
    if not all(0 < side < MAX_SIDE for side in sizes[:2]) or not all(side < MAX_SIDE for side in sizes[2:]):
        raise _damaged(path, f"its images have {sizes[0]}x{sizes[1]} and {sizes[2]}x{sizes[3]} pixels")
    if not (math.isfinite(shift) and shift > 0):
        raise _damaged(path, f"its depth has {shift} units a metre")
    extrinsics = matrices[1], matrices[3]
    return _Header(
        matrices[0], matrices[2], extrinsics, color_code, depth_code, tuple(sizes[:2]), tuple(sizes[2:]), shift, frames
    )


def _read(file, size: int, path: Path) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise _damaged(path, "it ends too early")
    return data


def _bytes_at(path: Path, start: int, size: int) -> bytes:
    try:
        with open_regular(path, MEND) as file:
            file.seek(start)
            return _read(file, size, path)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the file") from error


def _depth(path: Path, place: tuple[int, int], header: _Header, index: int) -> np.ndarray:
    data = _bytes_at(path, *place)
    width, height = header.depth
    if header.depth_compression == ZLIB_U16:
        data = inflated(data, 2 * width * height, f"{path} frame {index}")
    elif header.depth_compression != RAW_U16:
        raise InputError(f"{path} has depth of compression {header.depth_compression}, which is not read; zlib is")
    if len(data) != 2 * width * height:
        raise _damaged(path, f"the depth of frame {index} is not {width}x{height} pixels")
    return np.frombuffer(data, "<u2").reshape(height, width)


def inflated(data: bytes, size: int, label: str, bits: int = zlib.MAX_WBITS) -> bytes:
    """Unpack zlib to at most `size` bytes.

    Raises:
        InputError: it is damaged, or larger.
    """
    unpacker = zlib.decompressobj(bits)
    try:
        result = unpacker.decompress(data, size + 1)
    except zlib.error as error:
        raise InputError(f"{label} has depth that cannot be unpacked; copy the capture again") from error
    if len(result) > size:
        raise InputError(f"{label} has more depth than pixels; copy the capture again")
    return result


def _damaged(path: Path, why: str) -> InputError:
    return InputError(f"{path} is damaged: {why}; download it again")


READER = Reader(is_sens, read_sens, LAYOUT)
