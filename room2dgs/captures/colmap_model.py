"""COLMAP's sparse models, text or binary, read with a look at the file's length before any memory is asked for.

Formats: COLMAP's documentation (format.html) and its binary layout: little endian, counts before their items.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.captures.capture import RawPoints
from room2dgs.captures.lens import MODELS, Lens
from room2dgs.captures.text_files import floats, quaternion_pose, text_of
from room2dgs.errors import InputError

# by their numbers in binary files; those that are not read have a name and a number of parameters too
BINARY_MODELS = (
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION",
    "DIVISION", "SIMPLE_FISHEYE", "FISHEYE", "EUCM", "EQUIRECTANGULAR",
)  # fmt: skip
NO_POINT = np.uint64(2**64 - 1)
OBSERVATION = np.dtype([("x", "<f8"), ("y", "<f8"), ("point", "<u8")])
MAX_NAME = 4096


class ModelImage(NamedTuple):
    """An image of a model.

    Attributes:
        id, name, camera: as the model has them.
        cam_from_world: (4, 4).
        pixel: (N, 2) of its features that belong to points; point: (N,) uint64 their ids.
    """

    id: int
    name: str
    camera: int
    cam_from_world: np.ndarray
    pixel: np.ndarray
    point: np.ndarray


@dataclass
class Model:
    """A sparse model: cameras by id, images by id in rising order; points are read when they are asked for."""

    folder: Path
    cameras: dict[int, Lens] = field(default_factory=dict)
    images: list[ModelImage] = field(default_factory=list)

    def points(self) -> RawPoints:
        """The model's points with their tracks.

        Raises:
            InputError: the file is damaged.
        """
        binary = self.folder / "points3D.bin"
        ids, xyz, rgb, error = (
            _binary_points(binary) if binary.is_file() else _text_points(self.folder / "points3D.txt")
        )
        order = np.argsort(ids, kind="stable")
        ids, xyz, rgb, error = ids[order], xyz[order], rgb[order], error[order]
        shot, point, pixel = [], [], []
        for index, image in enumerate(self.images):
            place = np.searchsorted(ids, image.point)
            known = place < len(ids)
            known[known] = ids[place[known]] == image.point[known]
            shot.append(np.full(int(known.sum()), index, np.int32))
            point.append(place[known].astype(np.int32))
            pixel.append(image.pixel[known])
        return RawPoints(
            xyz,
            rgb,
            error,
            tuple(image.name for image in self.images),
            np.concatenate([*shot, np.zeros(0, np.int32)]),
            np.concatenate([*point, np.zeros(0, np.int32)]),
            np.concatenate([*pixel, np.zeros((0, 2))]),
        )

    @property
    def has_points(self) -> bool:
        return (self.folder / "points3D.bin").is_file() or (self.folder / "points3D.txt").is_file()


def is_model(folder: Path) -> bool:
    """Whether a folder holds a sparse model."""
    return any(all((folder / f"{name}{end}").is_file() for name in ("cameras", "images")) for end in (".bin", ".txt"))


def read_model(folder: Path) -> Model:
    """A sparse model; the binary one where there are both.

    Raises:
        InputError: a file is missing, damaged or of a kind that is not read.
    """
    binary = (folder / "images.bin").is_file() and (folder / "cameras.bin").is_file()
    cameras = _binary_cameras(folder / "cameras.bin") if binary else _text_cameras(folder / "cameras.txt")
    images = _binary_images(folder / "images.bin") if binary else _text_images(folder / "images.txt")
    found = sorted(images, key=lambda image: image.id)
    for image in found:
        if not image.name.isprintable():
            raise InputError(f"{folder} names the image {image.name!r}, which cannot be; export it again")
        if image.camera not in cameras:
            raise InputError(f"{folder} has no camera {image.camera} for its image {image.name}; export it again")
        cameras[image.camera].check()
    return Model(folder, cameras, found)


class _Bytes:
    """A binary file, read with its length in view."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.data = np.memmap(path, np.uint8, mode="r") if path.stat().st_size else np.zeros(0, np.uint8)
        except OSError as error:
            raise InputError(f"{path} cannot be read ({error.strerror}); check the file") from error
        self.place = 0

    def take(self, size: int) -> bytes:
        return self.view(size).tobytes()

    def view(self, size: int) -> np.ndarray:
        if size > len(self.data) - self.place:
            raise self.damaged("it ends too early")
        self.place += size
        return self.data[self.place - size : self.place]

    def values(self, form: str) -> tuple:
        return struct.unpack("<" + form, self.take(struct.calcsize("<" + form)))

    def count(self, least: int) -> int:
        """A number of items of at least so many bytes each."""
        (count,) = self.values("Q")
        if count * least > len(self.data) - self.place:
            raise self.damaged(f"it announces {count} items and has no room for them")
        return count

    def name(self) -> str:
        chunk = self.data[self.place : self.place + MAX_NAME]
        ends = np.flatnonzero(chunk == 0)
        if not len(ends):
            raise self.damaged("a name has no end")
        raw = self.take(int(ends[0]) + 1)[:-1]
        try:
            return raw.decode("utf-8")
        except UnicodeDecodeError as error:
            raise self.damaged("a name is no text") from error

    def damaged(self, why: str) -> InputError:
        return InputError(f"{self.path} is damaged: {why}; export the model again")


def _binary_cameras(path: Path) -> dict[int, Lens]:
    file = _Bytes(path)
    cameras = {}
    for _ in range(file.count(24)):
        number, model, width, height = file.values("IiQQ")
        if not 0 <= model < len(BINARY_MODELS):
            raise file.damaged(f"it has a camera of model {model}")
        name = BINARY_MODELS[model]
        if name not in MODELS:
            Lens(name, (), None, str(path)).check()
        params = file.values(f"{MODELS[name]}d")
        cameras[number] = Lens(name, params, _size(width, height, path), str(path))
    return cameras


def _binary_images(path: Path) -> Iterator[ModelImage]:
    file = _Bytes(path)
    for _ in range(file.count(73)):
        number, w, x, y, z, *t, camera = file.values("I7dI")
        name = file.name()
        count = file.count(OBSERVATION.itemsize)
        seen = file.view(count * OBSERVATION.itemsize).view(OBSERVATION)
        seen = seen[seen["point"] != NO_POINT]
        pixel = np.stack([seen["x"], seen["y"]], axis=1)
        pose = quaternion_pose(x, y, z, w, t, f"{path} (image {name})")
        yield ModelImage(number, name, camera, pose, pixel, seen["point"].astype(np.uint64))


def _binary_points(path: Path) -> tuple[np.ndarray, ...]:
    file = _Bytes(path)
    count = file.count(51)
    ids, error = np.zeros(count, np.uint64), np.zeros(count)
    xyz, rgb = np.zeros((count, 3)), np.zeros((count, 3), np.uint8)
    for index in range(count):
        ids[index], *values = file.values("Q3d3Bd")
        xyz[index], rgb[index], error[index] = values[:3], values[3:6], values[6]
        file.view(8 * file.count(8))
    return ids, xyz, rgb, error


def _text_cameras(path: Path) -> dict[int, Lens]:
    cameras = {}
    for line, text in _lines(path):
        words = text.split()
        if not words:
            continue
        try:
            number, model, width, height = int(words[0]), words[1], int(words[2]), int(words[3])
        except (ValueError, IndexError) as error:
            raise InputError(f"{path} line {line} is no camera; export the model again") from error
        params = tuple(floats(" ".join(words[4:]), path, line))
        cameras[number] = Lens(model, params, _size(width, height, path), str(path))
    return cameras


def _text_images(path: Path) -> Iterator[ModelImage]:
    """Two lines an image; the second, its features, may be empty."""
    lines = _lines(path)
    for line, text in lines:
        words = text.split(maxsplit=9)
        if not words:
            continue
        if len(words) < 10:
            raise InputError(f"{path} line {line} is no image; export the model again")
        values = floats(" ".join(words[1:8]), path, line, 7)
        try:
            number, camera = int(words[0]), int(words[8])
        except ValueError as error:
            raise InputError(f"{path} line {line} is no image; export the model again") from error
        w, x, y, z, *t = values
        pose = quaternion_pose(x, y, z, w, t, f"{path} line {line}")
        below, features = next(lines, (line + 1, ""))
        pixel, point = _text_features(features, path, below)
        yield ModelImage(number, words[9].strip(), camera, pose, pixel, point)


def _text_features(text: str, path: Path, line: int) -> tuple[np.ndarray, np.ndarray]:
    try:
        values = np.array(text.split(), np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(f"{path} line {line} holds no features (x, y, id each); export it again") from error
    seen = np.isfinite(values).all(axis=1) & (values[:, 2] >= 0) & (values[:, 2] < 2**53)
    return values[seen, :2], values[seen, 2].astype(np.uint64)


def _text_points(path: Path) -> tuple[np.ndarray, ...]:
    rows = []
    for line, text in _lines(path):
        words = text.split(maxsplit=8)
        if words:
            row = floats(" ".join(words[:8]), path, line, 8)
            if not (0 <= row[0] < 2**53):
                raise InputError(f"{path} line {line} has no id of a point; export the model again")
            rows.append(row)
    table = np.array(rows, np.float64).reshape(-1, 8)
    rgb = np.nan_to_num(table[:, 4:7]).clip(0, 255).astype(np.uint8)
    return table[:, 0].astype(np.uint64), table[:, 1:4], rgb, table[:, 7]


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """(number, text) of lines that are no comment; empty ones are kept: an image without features has one."""
    for number, text in enumerate(text_of(path).split("\n"), start=1):
        if not text.startswith("#"):
            yield number, text


def _size(width: int, height: int, path: Path) -> tuple[int, int]:
    if not (0 < width < 2**16 and 0 < height < 2**16):
        raise InputError(f"{path} has a camera of {width}x{height} pixels; export the model again")
    return width, height
