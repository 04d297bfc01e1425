"""The ScanNet layout: color/<i>.jpg, depth/<i>.png, pose/<i>.txt, intrinsic/*.txt.

Poses on disk are camera-to-world in metres with OpenCV axes. Depth is 16-bit millimetres, registered to the
photos, and optional. One set of intrinsics serves all photos; `scene.pixel_centres` says what cx, cy count.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from room2dgs.captures.image_files import color_size, depth_size
from room2dgs.captures.matrix_files import NonFinitePose, read_intrinsics, read_world_from_cam
from room2dgs.captures.scene import Dropped, Frame, Scene
from room2dgs.captures.selection import evenly_spaced, hold_out
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose

LAYOUT = "color/<i>.jpg, pose/<i>.txt and intrinsic/intrinsic_color.txt"
PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png")
MIN_VIEWS = 3
# The principal point of a whole photo lies near its middle; further off, the intrinsics are another size's.
MAX_OFF_CENTRE = 0.15
# Depth and colour cameras of one registered pair: relative difference of aspect ratio and of K.
MAX_DEPTH_MISMATCH = 0.05


@dataclass(frozen=True)
class _Entry:
    index: int
    color: Path
    world_from_cam: np.ndarray

    @property
    def name(self) -> str:
        return _name(self.index)


def read_scannet(config: SceneConfig) -> Scene:
    """Read a folder in ScanNet's layout.

    Frames are taken in numerical order: every `stride`-th, of these the ones with a finite pose, of these
    `frames` evenly spaced; then every `test_every`-th is held out.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    root = Path(config.path)
    _expect_folders(root)
    K = read_intrinsics(root / "intrinsic" / "intrinsic_color.txt")
    entries, dropped = _posed(root, _photos(root / "color")[:: config.stride])
    entries = evenly_spaced(entries, config.frames)
    if len(entries) < MIN_VIEWS:
        lost = f" ({len(dropped)} dropped: {dropped[0].reason})" if dropped else ""
        raise InputError(
            f"{root} has {len(entries)} usable views{lost}, at least {MIN_VIEWS} are needed; "
            "add frames or lower scene.stride"
        )
    size = _common_size([entry.color for entry in entries])
    _check_principal_point(root / "intrinsic" / "intrinsic_color.txt", K, size)
    depths = _depths(root, entries, K, size)

    half = 0.5 if config.pixel_centres == "integer" else 0.0
    K = K + np.array([[0.0, 0.0, half], [0.0, 0.0, half], [0.0, 0.0, 0.0]])
    frames = [
        Frame(entry.name, _camera(K, size, entry.world_from_cam, config.image_width), entry.color, depth)
        for entry, depth in zip(entries, depths, strict=True)
    ]
    train, test = hold_out(frames, config.test_every)
    if len(train) < MIN_VIEWS:
        raise InputError(
            f"scene.test_every={config.test_every} leaves {len(train)} of the {len(frames)} views in {root} "
            f"for training, at least {MIN_VIEWS} are needed; raise it, or set it to 0 to hold nothing out"
        )
    return Scene(root, tuple(train), tuple(test), tuple(dropped), _gt_mesh(root, config.gt_mesh))


def _name(index: int) -> str:
    return f"{index:06d}"


def _expect_folders(root: Path) -> None:
    if not root.is_dir():
        raise InputError(f"{root} is not a folder; give scene.path=DIR of a folder with {LAYOUT}")
    for name in ("color", "pose", "intrinsic"):
        if not (root / name).is_dir():
            raise InputError(f"{root / name} is missing; a capture in this layout has {LAYOUT}")


def _photos(folder: Path) -> list[tuple[int, Path]]:
    """(index, path) of every photo, in numerical order."""
    photos: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in PHOTO_SUFFIXES or not (path.stem.isascii() and path.stem.isdigit()):
            continue
        index = int(path.stem)
        if index in photos:
            raise InputError(f"{path} and {photos[index].name} are the same frame; delete one of them")
        photos[index] = path
    if not photos:
        raise InputError(f"{folder} has no photos; name them <number>.jpg or <number>.png")
    return sorted(photos.items())


def _posed(root: Path, photos: list[tuple[int, Path]]) -> tuple[list[_Entry], list[Dropped]]:
    entries, dropped = [], []
    for index, color in photos:
        try:
            entries.append(_Entry(index, color, read_world_from_cam(root / "pose" / f"{color.stem}.txt")))
        except NonFinitePose as reason:
            dropped.append(Dropped(_name(index), str(reason)))
    return entries, dropped


def _common_size(photos: list[Path]) -> tuple[int, int]:
    """(width, height) of all photos."""
    sizes = [color_size(path) for path in photos]
    for path, size in zip(photos, sizes, strict=True):
        if size != sizes[0]:
            raise InputError(
                f"{path} has {size[0]}x{size[1]} pixels and {photos[0].name} has "
                f"{sizes[0][0]}x{sizes[0][1]}, but they share intrinsics; give all photos one size"
            )
    return sizes[0]


def _check_principal_point(path: Path, K: np.ndarray, size: tuple[int, int]) -> None:
    off = np.abs(K[:2, 2] / np.array(size) - 0.5)
    if not (off <= MAX_OFF_CENTRE).all():
        raise InputError(
            f"{path} has its principal point at ({K[0, 2]:g}, {K[1, 2]:g}), which does not fit the photos of "
            f"{size[0]}x{size[1]} pixels; give the intrinsics of this image size"
        )


def _depths(root: Path, entries: list[_Entry], K: np.ndarray, size: tuple[int, int]) -> list[Path | None]:
    """The depth map of each frame, None where there is none; each is decoded once."""
    paths = [root / "depth" / f"{entry.color.stem}.png" for entry in entries]
    depths = [path if path.exists() else None for path in paths]
    present = [path for path in depths if path is not None]
    with ThreadPoolExecutor() as pool:
        sizes = list(pool.map(depth_size, present))
    for path, depth in zip(present, sizes, strict=True):
        if abs(depth[0] * size[1] / (depth[1] * size[0]) - 1.0) > MAX_DEPTH_MISMATCH:
            raise InputError(
                f"{path} has {depth[0]}x{depth[1]} pixels, another shape than the photos "
                f"of {size[0]}x{size[1]}; register depth to colour or delete the depth folder"
            )
    own = root / "intrinsic" / "intrinsic_depth.txt"
    if present and own.exists():
        _check_registered(own, read_intrinsics(own), sizes[0], K, size)
    return depths


def _check_registered(
    path: Path, K_depth: np.ndarray, depth: tuple[int, int], K: np.ndarray, size: tuple[int, int]
) -> None:
    """Both cameras must be the same up to image size: a depth map is resized to its photo, never warped."""
    scale = np.diag([size[0] / depth[0], size[1] / depth[1], 1.0])
    error = np.abs((scale @ K_depth - K)[:2]) / np.array([[K[0, 0]], [K[1, 1]]])
    if error.max() > MAX_DEPTH_MISMATCH:
        raise InputError(
            f"{path} is another camera than intrinsic_color.txt; register depth to colour or delete the depth folder"
        )


def _camera(K: np.ndarray, size: tuple[int, int], world_from_cam: np.ndarray, image_width: int | None) -> Camera:
    camera = Camera(K, *size, inverse_pose(world_from_cam))
    # Photos are never enlarged: that adds work and no detail.
    if image_width is None or image_width >= size[0]:
        return camera
    return camera.resized_to_width(image_width)


def _gt_mesh(root: Path, given: str | None) -> Path | None:
    path = Path(given) if given else root / "gt_mesh.ply"
    if path.is_file():
        return path
    if given:
        raise InputError(f"{path} is missing; give scene.gt_mesh the path of the ground-truth mesh")
    return None
