"""Polycam's raw data: keyframes/{corrected_images,corrected_cameras,depth} as a folder or a zip.

Cameras are camera-to-world with OpenGL axes (t_<row><column>), metres, world y up. Corrected photos are undistorted and
their poses loop-closed; their black borders are masked. Without them the plain ones are read, distorted and drifting.
"""

from __future__ import annotations

from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np

from room2dgs.captures.archives import MAX_ENTRY_BYTES, Archive
from room2dgs.captures.capture import C2W_OPENGL, Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.image_files import read_numbers
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural
from room2dgs.captures.photos import PhotoBytes
from room2dgs.captures.text_files import number, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.regular_files import read_regular

LAYOUT = "keyframes/{corrected_images,corrected_cameras} (Polycam raw data, folder or zip)"
BORDER_PX = 15


def is_polycam(files: Listing) -> bool:
    """keyframes/, or a zip with it."""
    if files.root.is_file():
        return files.root.suffix.lower() == ".zip" and _has_keyframes(files.root)
    if "keyframes" in files:
        return True
    zips = files.with_suffix((".zip",))
    return len(zips) == 1 and _has_keyframes(files.root / zips[0])


def _has_keyframes(path: Path) -> bool:
    try:
        return any(name.startswith("keyframes/") for name in Archive(path, "keyframes/").names)
    except InputError:
        return False


class _Files:
    """A capture's files, in a folder or in a zip."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._archive: Archive | None = None
        if not (root / "keyframes").is_dir():
            path = root if root.is_file() else next((root / n for n in Listing(root).with_suffix((".zip",))), None)
            if path is None:
                raise InputError(f"{root} has no keyframes/; a capture in this layout has {LAYOUT}")
            self.root, self._archive = path, Archive(path, "keyframes/")

    def names(self, folder: str) -> frozenset[str]:
        if self._archive is None:
            return listed(self.root / folder)
        start = f"{folder}/"
        return frozenset(name.removeprefix(start) for name in self._archive.names if name.startswith(start))

    def path(self, name: str) -> Path:
        return self.root / name

    def read(self, name: str) -> bytes:
        if self._archive is not None:
            return self._archive.read(name)
        return read_regular(self.path(name), MAX_ENTRY_BYTES)

    def photo(self, name: str) -> PhotoBytes | None:
        if self._archive is None:
            return None
        return PhotoBytes(str(self.path(name)), partial(self.read, name))


def read_polycam(root: Path, config: SceneConfig) -> Capture:
    """Read a capture of raw data.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    files = _Files(root)
    corrected = bool(files.names("keyframes/corrected_cameras")) and bool(files.names("keyframes/corrected_images"))
    start = "keyframes/corrected_" if corrected else "keyframes/"
    photos = {Path(name).stem: name for name in files.names(f"{start}images")}
    cameras = {Path(name).stem: name for name in files.names(f"{start}cameras") if name.endswith(".json")}
    depths = {Path(name).stem: name for name in files.names("keyframes/depth") if name.endswith(".png")}
    both = natural(photos.keys() & cameras.keys())
    if not both:
        raise InputError(f"{files.root} has no photos with cameras in {start}images, {start}cameras; export it again")
    shots = [_shot(files, start, photos[n], cameras[n], depths.get(n), corrected, config) for n in both]
    notes, warnings = [], []
    missing = len(photos.keys() | cameras.keys()) - len(both)
    if missing:
        notes.append(f"keyframes: {missing} have a photo without a camera or a camera without a photo")
    if not corrected:
        warnings.append("corrected_images/ is not there: plain photos are read, whose poses drift and lenses distort")
    mesh = gt_mesh_in(root) if root.is_dir() else None
    return Capture(
        root,
        "polycam",
        shots,
        C2W_OPENGL,
        gt_mesh=mesh,
        notes=notes,
        warnings=warnings,
        why="ARKit's poses are metres",
    )


def _shot(files: _Files, start: str, photo: str, camera: str, depth: str | None, corrected: bool, config: SceneConfig):
    name = f"{start}cameras/{camera}"
    known = read_json_object(files.path(name), files.read(name))
    source = files.path(name)
    pose = np.eye(4)
    pose[:3] = [[number(known, f"t_{row}{column}", source) for column in range(4)] for row in range(3)]
    size = int(number(known, "width", source)), int(number(known, "height", source))
    values = [number(known, key, source) for key in ("fx", "fy", "cx", "cy")]
    place = f"{start}images/{photo}"
    depth_map = None
    if depth is not None:
        label = f"keyframes/depth/{depth}"
        depth_map = DepthMap(str(files.path(label)), partial(_depth, files, label), 0.001)
    return Shot(
        Path(photo).stem,
        files.path(place),
        pose,
        pinhole_lens(*values, size, source, config.pixel_centres != "integer"),
        files.photo(place),
        depth_map,
        BorderMask(size, BORDER_PX) if corrected else None,
    )


def _depth(files: _Files, name: str) -> np.ndarray:
    return read_numbers(BytesIO(files.read(name)), files.path(name))


class BorderMask:
    """White but for a border of some pixels: a mask that no file holds."""

    def __init__(self, size: tuple[int, int], border: int) -> None:
        self._size, self._border = size, border

    def size(self) -> tuple[int, int]:
        return self._size

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        width, height = size or self._size
        border = max(1, round(self._border * width / 1024))
        white = np.zeros((height, width, 3), np.uint8)
        white[border:-border, border:-border] = 255
        return white

    def check(self) -> None:
        """There is nothing to read."""

    def digest(self) -> bytes:
        return f"border {self._size} {self._border}".encode()
