"""Map cache: a network's map of one photo on disk, .npz with "map" and, where the network gives it, "error"."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE, whole_file
from room2dgs.regular_files import open_regular

SUFFIX = ".npz"
KINDS = (np.dtype(np.float16), np.dtype(np.float32))
# Marks a photo for which the network has no valid pixel.
_EMPTY = ".empty"


def is_cached(path: Path, shape: tuple[int, ...]) -> bool:
    """Whether a whole map of this shape is cached, or is known to be empty; reads its headers alone."""
    if is_empty(path):
        return True
    try:
        with open_regular(path) as raw, zipfile.ZipFile(raw) as archive:
            known = {name: _header(archive, name) for name in ("map.npy", "error.npy") if name in archive.namelist()}
    except (InputError, *NUMPY_DAMAGE):
        return False
    shapes = [known.get("map.npy", ((), None))[0], known.get("error.npy", (shape[:2], None))[0]]
    return shapes == [shape, shape[:2]] and all(kind in KINDS for _, kind in known.values())


def is_empty(path: Path) -> bool:
    """Whether the network has no valid pixel for this photo."""
    return path.with_suffix(_EMPTY).exists()


def write_map(path: Path, values: np.ndarray, valid: np.ndarray, error: np.ndarray | None) -> None:
    """Write a map, float16 where that keeps three digits.

    Args:
        values: (H, W) or (H, W, 3).
        valid: (H, W) bool; other pixels are written as 0, with an infinite error.
        error: (H, W) or None.

    Raises:
        OSError: the disk refuses.
    """
    if not valid.any() or not values[valid].any():
        with whole_file(path.with_suffix(_EMPTY)) as temporary:
            temporary.write_bytes(b"")
        return
    arrays = {"map": _short(np.where(valid if values.ndim == 2 else valid[..., None], values, 0.0), values.ndim == 2)}
    if error is not None:
        arrays["error"] = _short(np.where(valid, error, np.inf), True)
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]  # numpy's stubs take the keywords for `allow_pickle`


def _header(archive: zipfile.ZipFile, name: str) -> tuple[tuple[int, ...], np.dtype]:
    with archive.open(name) as file:
        np.lib.format.read_magic(file)
        shape, _, kind = np.lib.format.read_array_header_1_0(file)
    return shape, kind


def has_array(path: Path, name: str) -> bool:
    """Whether the file has "map" or "error"; its numbers are not read.

    Raises:
        InputError: the file is damaged.
    """
    try:
        with open_regular(path) as raw, np.load(raw, allow_pickle=False) as arrays:
            return name in arrays
    except NUMPY_DAMAGE as error:
        raise InputError(f"{path} cannot be read; delete it, and it is made again") from error


def read_array(path: Path, name: str) -> np.ndarray | None:
    """ "map" or "error" as float32; None where the file has no such array.

    Raises:
        InputError: the file is damaged.
    """
    try:
        with open_regular(path) as raw, np.load(raw, allow_pickle=False) as arrays:
            return arrays[name].astype(np.float32) if name in arrays else None
    except NUMPY_DAMAGE as error:
        raise InputError(f"{path} cannot be read; delete it, and it is made again") from error


def _short(values: np.ndarray, relative: bool) -> np.ndarray:
    values = values.astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        half = values.astype(np.float16)
        off = np.abs(half.astype(np.float32) - values)
    known = np.isfinite(values)
    close = off[known] <= 1e-3 * (np.abs(values[known]) if relative else 1.0)
    return half if close.all() else values
