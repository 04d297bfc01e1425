"""Polycam's raw data: keyframes/{corrected_images,corrected_cameras,depth} as a folder or a zip.

Cameras are camera-to-world with OpenGL axes (t_<row><column>), metres, world y up. Corrected photos are undistorted and
their poses loop-closed; their black borders are masked. Without them the plain ones are read, distorted and drifting.
"""

from __future__ import annotations

from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.archives import MAX_ENTRY_BYTES, Archive
from room2dgs.captures.capture import C2W_OPENGL, Capture, Shot, damaged, pinhole_lens
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.image_files import read_numbers
from room2dgs.captures.known_keys import DISTORTION, check_no_distortion, unknown_in
from room2dgs.captures.left_out import some
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural
from room2dgs.captures.photos import PhotoBytes
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import number, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.regular_files import read_regular

LAYOUT = "keyframes/{corrected_images,corrected_cameras} (Polycam raw data, folder or zip)"
BORDER_PX = 15
KEYS = {
    *DISTORTION,
    *(f"t_{row}{column}" for row in range(3) for column in range(4)),
    *("fx", "fy", "cx", "cy", "width", "height"),
    # change nothing
    *("blur_score", "timestamp", "angular_velocity", "velocity", "center_depth", "neighbors", "manual_keyframe"),
    *("exposure", "iso", "id"),
}


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
    half = config.pixel_centres != "integer"
    both = natural(photos.keys() & cameras.keys())
    if not both and not corrected and files.names("keyframes/corrected_cameras"):
        raise InputError(
            f"{files.root} has keyframes/corrected_cameras and no keyframes/corrected_images, which they are for; "
            "export it again"
        )
    if not both:
        raise InputError(f"{files.root} has no photos with cameras in {start}images, {start}cameras; export it again")
    known = {name: _camera(files, f"{start}cameras/{cameras[name]}") for name in both}
    shots = [
        _shot(
            files,
            known[n],
            f"{start}cameras/{cameras[n]}",
            f"{start}images/{photos[n]}",
            depths.get(n),
            corrected,
            half,
        )
        for n in both
    ]
    notes, warnings = [], []
    unknown = unknown_in(known.values(), KEYS, files.root / f"{start}cameras")
    if unknown:
        notes.append(unknown)
    plain = {Path(name).stem for name in files.names("keyframes/images")} if corrected else set()
    if plain - photos.keys():
        notes.append(
            f"keyframes: {len(plain - photos.keys())} photos of images/ are not in corrected_images/ and are not used: "
            f"{some(natural(plain - photos.keys()))}"
        )
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


def _camera(files: _Files, name: str) -> dict[str, Any] | InputError:
    """A camera's file, or why it cannot be read: that costs its photo."""
    try:
        known = read_json_object(files.path(name), files.read(name))
        check_no_distortion(known, files.path(name))
    except InputError as error:
        return error
    return known


def _shot(
    files: _Files,
    known: dict[str, Any] | InputError,
    camera: str,
    photo: str,
    depth: str | None,
    corrected: bool,
    half: bool,
) -> Shot:
    pose, lens, size = _pose_and_lens(known, files.path(camera), half)
    depth_map = None
    if depth is not None:
        label = f"keyframes/depth/{depth}"
        depth_map = DepthMap(str(files.path(label)), partial(_depth, files, label), 0.001)
    return Shot(
        Path(photo).stem,
        files.path(photo),
        pose,
        lens,
        files.photo(photo),
        depth_map,
        BorderMask(size, BORDER_PX) if corrected and size else None,
    )


def _pose_and_lens(known: dict[str, Any] | InputError, source: Path, half: bool):
    """Pose, lens and (width, height) of a camera's file; of a damaged one a pose that says so."""
    try:
        if isinstance(known, InputError):
            raise known
        pose = np.eye(4)
        pose[:3] = [[number(known, f"t_{row}{column}", source) for column in range(4)] for row in range(3)]
        size = int(number(known, "width", source)), int(number(known, "height", source))
        fx, fy, cx, cy = (number(known, key, source) for key in ("fx", "fy", "cx", "cy"))
        return pose, pinhole_lens(fx, fy, cx, cy, size, source, half), size
    except InputError as error:
        return damaged(error), None, None


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


READER = Reader(is_polycam, read_polycam, LAYOUT, ("nerfstudio",))
