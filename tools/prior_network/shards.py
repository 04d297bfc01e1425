"""Rendered rooms on disk: folders of arrays, one sample a row."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE

# file -> (dimensions, type)
ARRAYS = {"radiance": (4, np.uint8), "depth": (3, np.float16), "normal": (4, np.int8), "focal": (1, np.float32)}
NORMAL_UNIT = 127.0


class Sample(NamedTuple):
    """One view of a room.

    Attributes:
        radiance: (H, W, 3) uint8, see `photographic.linear_radiance`.
        depth: (H, W) float16 metres along z, 0 = invalid.
        normal: (H, W, 3) int8, 127 * n in camera axes (OpenCV), 0 = invalid.
        focal: pixels; the principal point is the image's middle.
    """

    radiance: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    focal: float


@dataclass(frozen=True)
class Shard:
    """A shard's arrays, read from the disk as they are needed."""

    path: Path
    radiance: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    focal: np.ndarray

    def __len__(self) -> int:
        return len(self.focal)


class Shards:
    """Several shards as one row of samples."""

    def __init__(self, shards: list[Shard]) -> None:
        self.shards = shards
        self._ends = np.cumsum([len(shard) for shard in shards])

    def __len__(self) -> int:
        return int(self._ends[-1]) if self.shards else 0

    def __getitem__(self, index: int) -> Sample:
        number = int(np.searchsorted(self._ends, index, side="right"))
        shard = self.shards[number]
        row = index - int(self._ends[number]) + len(shard)
        return Sample(shard.radiance[row], shard.depth[row], shard.normal[row], float(shard.focal[row]))

    @property
    def names(self) -> list[str]:
        """Folder names, in order."""
        return [shard.path.name for shard in self.shards]


def shard_names(folder: Path) -> list[str]:
    """Names of the complete shards, sorted.

    Raises:
        InputError: the folder is missing or holds none.
    """
    if not folder.is_dir():
        raise InputError(
            f"{folder} is not a folder; make training data first (python -m room2dgs.tools.make_prior_data)"
        )
    names = sorted(path.name for path in folder.iterdir() if not path.name.startswith(".") and _is_shard(path))
    if not names:
        raise InputError(f"{folder} holds no shards; make some first (python -m room2dgs.tools.make_prior_data)")
    return names


def open_shards(folder: Path, names: list[str]) -> Shards:
    """Opens the named shards, which must be of one image size.

    Raises:
        InputError: a shard is missing, damaged or of another shape than its fellows.
    """
    shards = [_open(folder / name) for name in names]
    for shard in shards:
        if shard.depth.shape[1:] != shards[0].depth.shape[1:]:
            raise InputError(
                f"{shard.path} has images of {_size(shard)} but {shards[0].path.name} has {_size(shards[0])}; "
                "keep shards of one size in a folder"
            )
    return Shards(shards)


def _is_shard(path: Path) -> bool:
    return (path / "focal.npy").is_file()


def _open(path: Path) -> Shard:
    arrays = {}
    for name, (dimensions, dtype) in ARRAYS.items():
        file = path / f"{name}.npy"
        try:
            array = np.load(file, mmap_mode="r")
        except NUMPY_DAMAGE as error:
            raise InputError(f"{file} cannot be read; delete the shard {path.name} or make it again") from error
        if array.ndim != dimensions or array.dtype != dtype:
            raise InputError(
                f"{file} is {array.dtype} with {array.ndim} dimensions, not {np.dtype(dtype)} with {dimensions}; "
                "make the shard again"
            )
        arrays[name] = array
    count, height, width = arrays["depth"].shape
    wanted = {"radiance": (count, height, width, 3), "normal": (count, height, width, 3), "focal": (count,)}
    for name, shape in wanted.items():
        if arrays[name].shape != shape or count == 0:
            raise InputError(
                f"{path / name}.npy has shape {arrays[name].shape}, not {shape} as depth.npy asks; make the shard again"
            )
    return Shard(path, **arrays)


def _size(shard: Shard) -> str:
    height, width = shard.depth.shape[1:]
    return f"{width}x{height}"
