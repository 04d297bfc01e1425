"""COLMAP's sparse models, text or binary, read with a look at the file's length before any memory is asked for.

Formats: COLMAP's documentation (format.html) and its binary layout: little endian, counts before their items.

pycolmap.Reconstruction does not read captures: it asks for as much memory as a damaged count announces, and takes a
camera file that was cut short for a whole one. It also refuses a model without points, and a whole model for one item.
"""

from __future__ import annotations

import struct
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.captures.capture import RawPoints
from room2dgs.captures.left_out import left_out
from room2dgs.captures.lens import MODELS, Lens
from room2dgs.captures.photo_names import check_count
from room2dgs.captures.text_files import floats, quaternion_pose, text_of
from room2dgs.errors import InputError
from room2dgs.regular_files import check_regular
from room2dgs.texts import shown_name

# by their numbers in binary files; those that are not read have a name and a number of parameters too
BINARY_MODELS = (
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION",
    "DIVISION", "SIMPLE_FISHEYE", "FISHEYE", "EUCM", "EQUIRECTANGULAR",
)  # fmt: skip
# of those that are not read: so that they can be passed over
OTHER_MODELS = {
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
    "SIMPLE_DIVISION": 4,
    "DIVISION": 5,
    "SIMPLE_FISHEYE": 3,
    "FISHEYE": 4,
    "EUCM": 6,
    "EQUIRECTANGULAR": 2,
}
CAMERA = struct.Struct("<IiQQ")  # id, model, width, height
LENGTH = struct.Struct("<Q")
POINT = np.dtype([("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8")])  # the track's length follows
POINTS_AT_ONCE = 1 << 16
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
    """A sparse model; points are read when they are asked for.

    Attributes:
        folder: where it lies.
        cameras: by id, those that an image has.
        images: by id in rising order; one whose rotation cannot be read has a pose of NaN.
        warnings: sentences on such images.
    """

    folder: Path
    cameras: dict[int, Lens] = field(default_factory=dict)
    images: list[ModelImage] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

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
        """An empty points3D.txt is how COLMAP is told poses that were known before."""
        text = self.folder / "points3D.txt"
        return (self.folder / "points3D.bin").is_file() or (text.is_file() and text.stat().st_size > 0)


def is_model(folder: Path) -> bool:
    """Whether a folder holds a sparse model."""
    return any(all((folder / f"{name}{end}").is_file() for name in ("cameras", "images")) for end in (".bin", ".txt"))


def read_model(folder: Path) -> Model:
    """A sparse model; the binary one where there are both.

    Raises:
        InputError: a file is missing, damaged or of a kind that is not read.
    """
    bad: dict[str, str] = {}
    if is_binary(folder):
        images = list(_binary_images(folder / "images.bin", bad))
        cameras = _binary_cameras(folder / "cameras.bin", {image.camera for image in images})
    else:
        images = list(_text_images(folder / "images.txt", bad))
        cameras = _text_cameras(folder / "cameras.txt", {image.camera for image in images})
    found = sorted(images, key=lambda image: image.id)
    for image in found:
        if not image.name.isprintable():
            raise InputError(f"{folder} names the image {image.name!r}, which cannot be; export it again")
        if image.camera not in cameras:
            raise InputError(f"{folder} has no camera {image.camera} for its image {image.name}; export it again")
    for lens in cameras.values():
        lens.check()
    twice = [name for name, count in Counter(image.name for image in found).items() if count > 1]
    if twice:
        raise InputError(f"{folder} has the image {shown_name(twice[0])} twice; export the model again")
    message = left_out(bad, len(found), "images whose rotation is none")
    return Model(folder, cameras, found, [f"{folder}: {message}"] if message else [])


def is_binary(folder: Path) -> bool:
    """Whether it is the binary model that is read."""
    return (folder / "images.bin").is_file() and (folder / "cameras.bin").is_file()


def count_in_text(folder: Path) -> int | None:
    """Number of images of the text model; None: there is none.

    Raises:
        InputError: it is no text.
    """
    path = folder / "images.txt"
    if not (path.is_file() and (folder / "cameras.txt").is_file()):
        return None
    lines = [text for _, text in _lines(path)]
    count = place = 0
    while place < len(lines):
        image = bool(lines[place].strip())
        count += image
        place += 2 if image else 1
    return count


class _Bytes:
    """A binary file, read with its length in view."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.data = np.memmap(path, np.uint8, mode="r") if check_regular(path) else np.zeros(0, np.uint8)
        except OSError as error:
            raise InputError(f"{path} cannot be read ({error.strerror}); check the file") from error
        self.place = 0

    def read(self, size: int) -> bytes:
        return self.view(size).tobytes()

    def view(self, size: int) -> np.ndarray:
        if size > len(self.data) - self.place:
            raise self.damaged("it ends too early")
        self.place += size
        return self.data[self.place - size : self.place]

    def values(self, form: str) -> tuple:
        return struct.unpack("<" + form, self.read(struct.calcsize("<" + form)))

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
        raw = self.read(int(ends[0]) + 1)[:-1]
        try:
            return raw.decode("utf-8")
        except UnicodeDecodeError as error:
            raise self.damaged("a name is no text") from error

    def damaged(self, why: str) -> InputError:
        return InputError(f"{self.path} is damaged: {why}; export the model again")


def _binary_cameras(path: Path, wanted: Collection[int]) -> dict[int, Lens]:
    """The cameras that images have; the others are passed over, millions of them in a second."""
    file = _Bytes(path)
    count = file.count(CAMERA.size)
    data, place, end = file.data.data, file.place, len(file.data)
    lengths = [8 * (MODELS.get(name) or OTHER_MODELS[name]) for name in BINARY_MODELS]
    cameras = {}
    for _ in range(count):
        if place + CAMERA.size > end:
            raise file.damaged("it ends too early")
        number, model, width, height = CAMERA.unpack_from(data, place)
        if not 0 <= model < len(BINARY_MODELS):
            raise file.damaged(f"it has a camera of model {model}")
        place += CAMERA.size + lengths[model]
        if place > end:
            raise file.damaged("it ends too early")
        if number in wanted:
            name = BINARY_MODELS[model]
            params = struct.unpack_from(f"<{lengths[model] // 8}d", data, place - lengths[model])
            cameras[number] = Lens(name, params, _size(width, height, path), str(path))
    return cameras


def _binary_images(path: Path, bad: dict[str, str]) -> Iterator[ModelImage]:
    file = _Bytes(path)
    count = file.count(73)
    check_count(count, path)
    for _ in range(count):
        number, w, x, y, z, *t, camera = file.values("I7dI")
        name = file.name()
        count = file.count(OBSERVATION.itemsize)
        seen = file.view(count * OBSERVATION.itemsize).view(OBSERVATION)
        seen = seen[seen["point"] != NO_POINT]
        pixel = np.stack([seen["x"], seen["y"]], axis=1)
        pose = _pose((w, x, y, z), t, f"{path} (image {shown_name(name)})", name, bad)
        yield ModelImage(number, name, camera, pose, pixel, seen["point"].astype(np.uint64))


def _pose(wxyz: tuple[float, ...], t: list[float], label: str, name: str, bad: dict[str, str]) -> np.ndarray:
    """(4, 4); NaN, and a sentence in `bad`, where the quaternion is no rotation."""
    w, x, y, z = wxyz
    try:
        return quaternion_pose(x, y, z, w, t, label)
    except InputError as error:
        bad[name] = str(error)
        return np.full((4, 4), np.nan)


def _binary_points(path: Path) -> tuple[np.ndarray, ...]:
    file = _Bytes(path)
    places = _point_places(file, file.count(POINT.itemsize + LENGTH.size))
    ids, error = np.zeros(len(places), np.uint64), np.zeros(len(places))
    xyz, rgb = np.zeros((len(places), 3)), np.zeros((len(places), 3), np.uint8)
    offset = np.arange(POINT.itemsize)
    for start in range(0, len(places), POINTS_AT_ONCE):
        part = slice(start, start + POINTS_AT_ONCE)
        rows = np.ascontiguousarray(file.data[places[part, None] + offset]).view(POINT)[:, 0]
        ids[part], xyz[part], rgb[part], error[part] = rows["id"], rows["xyz"], rows["rgb"], rows["error"]
    return ids, xyz, rgb, error


def _point_places(file: _Bytes, count: int) -> np.ndarray:
    """(count,) int64 where each point begins: behind the track of the one before."""
    data, place, last = file.data.data, file.place, len(file.data) - POINT.itemsize - LENGTH.size
    places = array("q")
    for _ in range(count):
        if place > last:
            raise file.damaged("it ends too early")
        places.append(place)
        place += POINT.itemsize + LENGTH.size + 8 * LENGTH.unpack_from(data, place + POINT.itemsize)[0]
    if place > len(data):
        raise file.damaged("it ends too early")
    return np.frombuffer(places, np.int64) if places else np.zeros(0, np.int64)


def _text_cameras(path: Path, wanted: Collection[int]) -> dict[int, Lens]:
    ids = {str(number) for number in wanted}
    cameras = {}
    for line, text in _lines(path):
        first = text.split(maxsplit=1)
        if not first or (first[0].isdecimal() and first[0].lstrip("0") not in ids and first[0] not in ids):
            continue
        words = text.split()
        try:
            number, model, width, height = int(words[0]), words[1], int(words[2]), int(words[3])
        except (ValueError, IndexError) as error:
            raise InputError(f"{path} line {line} is no camera; export the model again") from error
        params = tuple(floats(" ".join(words[4:]), path, line))
        cameras[number] = Lens(model, params, _size(width, height, path), str(path))
    return cameras


def _text_images(path: Path, bad: dict[str, str]) -> Iterator[ModelImage]:
    """Two lines an image; the second, its features, may be empty."""
    lines = _lines(path)
    count = 0
    for line, text in lines:
        words = text.split(maxsplit=9)
        if not words:
            continue
        count += 1
        check_count(count, path)
        if len(words) < 10:
            raise InputError(f"{path} line {line} is no image; export the model again")
        values = floats(" ".join(words[1:8]), path, line, 7)
        try:
            number, camera = int(words[0]), int(words[8])
        except ValueError as error:
            raise InputError(f"{path} line {line} is no image; export the model again") from error
        w, x, y, z, *t = values
        name = words[9].strip()
        pose = _pose((w, x, y, z), t, f"{path} line {line}", name, bad)
        below, features = next(lines, (line + 1, ""))
        pixel, point = _text_features(features, path, below)
        yield ModelImage(number, name, camera, pose, pixel, point)


def _text_features(text: str, path: Path, line: int) -> tuple[np.ndarray, np.ndarray]:
    try:
        values = np.array(text.split(), np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(f"{path} line {line} holds no features (x, y, id each); export it again") from error
    seen = np.isfinite(values).all(axis=1) & (values[:, 2] >= 0) & (values[:, 2] < 2**53)
    return values[seen, :2], values[seen, 2].astype(np.uint64)


def _text_points(path: Path) -> tuple[np.ndarray, ...]:
    """The first eight words of each line; what follows, the track, is known from the images."""
    values = array("d")
    for line, text in _lines(path):
        words = text.split(maxsplit=8)[:8]
        try:
            values.extend(map(float, words))
            usable = not words or (len(words) == 8 and 0 <= values[-8] < 2**53)
        except ValueError:
            usable = False
        if not usable:
            raise InputError(f"{path} line {line} is no point (id, x, y, z, r, g, b, error); export the model again")
    table = np.frombuffer(values, np.float64).reshape(-1, 8) if values else np.zeros((0, 8))
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
