"""Photos with known depth and normals to measure a prior on: captures, or rooms made for training networks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.bench.prior_truth import Truth, frame_truth, truth_source
from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Frame
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.eval.surface import Surface
from room2dgs.files import NUMPY_DAMAGE
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.world import read_in_scene

RADIANCE = "radiance.npy"  # what a folder of made rooms has, and no capture
ARRAYS = ("radiance", "depth", "normal", "focal")  # as `room2dgs.tools.make_prior_data` writes them
EXACT = "exact"  # truth of made rooms
BRIGHTEST, GAMMA = 4.0, 2.2  # of the stored radiance: round(255 (min(L, 4) / 4)^(1 / 2.2))


class View(NamedTuple):
    """One photo with its truth.

    Attributes:
        photo: (H, W, 3) uint8 RGB at its full size.
        photo_camera: of that size.
        camera: the same view at the size of the truth.
        frame: of a capture, None for a made room.
    """

    name: str
    photo: np.ndarray
    photo_camera: Camera
    camera: Camera
    truth: Truth
    frame: Frame | None


class Views(NamedTuple):
    """The photos of one scene, read one at a time.

    Attributes:
        source: where the true normals come from, see `room2dgs.bench.prior_truth`; `EXACT` for made rooms.
    """

    name: str
    source: str
    photos: int
    views: Iterator[View]


def scene_views(config: SceneConfig) -> Views:
    """The photos of a capture with depth, or of made rooms (a shard, or a folder of shards), evenly spaced.

    Raises:
        InputError: the folder is neither, or a file in it cannot be read.
    """
    path = Path(config.path)
    shards = _shards(path)
    return _made(path, shards, config.frames) if shards else _captured(path, config)


def _captured(path: Path, config: SceneConfig) -> Views:
    scene = read_scene(config)
    frames = [frame for frame in scene.frames if frame.depth_path]
    if not frames:
        raise InputError(f"{path / 'depth'} has no depth maps; a prior is measured against true depth")
    surface = Surface(read_in_scene(scene.gt_mesh, scene.origin_m)) if scene.gt_mesh else None
    source = truth_source(frames, surface)
    return Views(path.name, source, len(frames), _frames(frames, surface, source))


def _frames(frames: Sequence[Frame], surface: Surface | None, source: str) -> Iterator[View]:
    for frame in frames:
        full = frame.camera.resized(*frame.full_size())
        photo = replace(frame, camera=full).color()
        yield View(frame.name, photo, full, frame.camera, frame_truth(frame, surface, source), frame)


def _shards(path: Path) -> list[Path]:
    """The folders of made rooms that a path stands for: itself, or those in it."""
    if (path / RADIANCE).is_file():
        return [path]
    return sorted(file.parent for file in path.glob(f"*/{RADIANCE}"))


def _made(path: Path, shards: Sequence[Path], frames: int | None) -> Views:
    opened = [_opened(shard) for shard in shards]
    places = [(shard, index) for shard, arrays in enumerate(opened) for index in range(len(arrays[0]))]
    chosen = evenly_spaced(places, frames)
    views = (_picture(shards[shard].name, opened[shard], index) for shard, index in chosen)
    return Views(path.name, EXACT, len(chosen), views)


def _opened(shard: Path) -> list[np.ndarray]:
    """Radiance, depth, normals and focal lengths, not yet read."""
    try:
        arrays = [np.load(shard / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in ARRAYS]
    except NUMPY_DAMAGE as error:
        raise InputError(f"{shard} is no whole folder of made rooms ({error}); make it again") from error
    if len({len(values) for values in arrays}) != 1:
        raise InputError(f"{shard} has arrays of different lengths; make it again")
    return arrays


def _picture(shard: str, arrays: Sequence[np.ndarray], index: int) -> View:
    radiance, depth, normal, focal = (np.asarray(values[index]) for values in arrays)
    height, width = depth.shape
    K = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]], dtype=np.float64)
    camera = Camera(K, width, height, np.eye(4))
    # what is brighter than display white is cut off, as a camera does
    photo = np.minimum(np.round(radiance * BRIGHTEST ** (1.0 / GAMMA)), 255.0).astype(np.uint8)
    length = np.linalg.norm(normal.astype(np.float64), axis=-1, keepdims=True)
    unit = np.where(length > 0, normal / np.where(length > 0, length, 1.0), 0.0)
    return View(f"{shard}/{index}", photo, camera, camera, Truth(depth.astype(np.float64), unit), None)
