"""Sensor depth as stored on disk and as the photo's camera sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from room2dgs.captures.depth_at import depth_at
from room2dgs.captures.exr_files import exr_size, read_exr
from room2dgs.captures.image_files import color_size, read_numbers
from room2dgs.captures.lens import Lens
from room2dgs.captures.opened_images import MOST_DEPTH_PIXELS
from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE
from room2dgs.geometry.camera import Camera
from room2dgs.regular_files import check_regular


@dataclass(frozen=True)
class DepthMap:
    """Depth of a sensor that looks along the photo's axis from the photo's place.

    Attributes:
        label: what messages call it.
        read: (H, W) numbers, read anew each time.
        unit_m: metres of one of them.
        K: (3, 3) of the sensor, pixel centres at +0.5; None: the photo's, scaled to the map.
        K_size: (width, height) that K is for; None: the map's own.
        distorted: the map has the photo's distortion; False: it is a pinhole image.
        invalid: a number besides 0, and all that is not finite, that stands for no depth.
        stored: (width, height) where it is known without reading the map.
        zoom: by what the photo's focal lengths were multiplied since; the map's pixels stay with the photo's.
    """

    label: str
    read: Callable[[], np.ndarray] = field(compare=False)
    unit_m: float = 0.001
    K: tuple[tuple[float, ...], ...] | None = None
    K_size: tuple[int, int] | None = None
    distorted: bool = True
    invalid: float | None = None
    stored: tuple[int, int] | None = None
    zoom: float = 1.0

    def size(self) -> tuple[int, int] | None:
        """(width, height), by the header where there is one; None: it cannot be read, whoever reads it tells."""
        if self.stored is not None:
            return self.stored
        try:
            by_header = getattr(self.read, "size", None)
            shape = self.read().shape if by_header is None else by_header()[::-1]
        except InputError:
            return None
        return (int(shape[1]), int(shape[0])) if len(shape) == 2 else None

    def metres(self) -> np.ndarray:
        """(H, W) float32 z-depth as stored, 0 = invalid.

        Raises:
            InputError: it cannot be decoded.
        """
        stored = self.read()
        if stored.ndim != 2 or not stored.size:
            raise InputError(f"{self.label} is not a one-channel depth map; replace it")
        with np.errstate(invalid="ignore", over="ignore"):  # a file's numbers may be anything
            depth = stored.astype(np.float32) * np.float32(self.unit_m)
        good = np.isfinite(depth) & (depth > 0)
        if self.invalid is not None:
            good &= stored != self.invalid
        return np.where(good, depth, np.float32(0))

    def seen_by(self, camera: Camera, lens: Lens | None) -> np.ndarray:
        """(H, W) float32 metres at the camera's size, where its rays meet the map (`depth_at`); 0 = invalid.

        Args:
            camera: at the photo's place.
            lens: of the photo as stored, if it distorts.
        """
        depth = self.metres()
        height, width = depth.shape
        rays = camera.zoomed(1 / self.zoom).rays()
        if self.K is not None:
            pixel = rays[..., :2] * np.array([self.K[0][0], self.K[1][1]]) + np.array([self.K[0][2], self.K[1][2]])
            if self.K_size is not None:
                pixel = pixel * np.divide((width, height), self.K_size)
        elif lens is not None and self.distorted:
            pixel = lens.project(rays.reshape(-1, 3)).reshape((*rays.shape[:2], 2)) * (width, height) / lens.size
        elif lens is not None:
            K = lens.K
            pixel = (rays[..., :2] * (K[0, 0], K[1, 1]) + (K[0, 2], K[1, 2])) * (width, height) / lens.size
        else:
            pixel = camera.pixels() * (width, height) / camera.size
        return depth_at(depth, pixel)


def depth_file(path: Path, unit_m: float = 0.001, **options) -> DepthMap:
    """Depth in an image of 16 or 32 bits, in a .npy or in a .exr.

    Args:
        options: other attributes of the map.
    """
    kinds: dict[str, Callable[[Path], Callable[[], np.ndarray]]] = {".npy": _NpyFile, ".exr": _ExrFile}
    read = kinds.get(path.suffix.lower(), _ImageFile)(path)
    return DepthMap(str(path), read, unit_m, **options)


@dataclass(frozen=True)
class _ImageFile:
    path: Path

    def size(self) -> tuple[int, int]:
        return color_size(self.path)

    def __call__(self) -> np.ndarray:
        return read_numbers(self.path)


@dataclass(frozen=True)
class _ExrFile:
    path: Path

    def size(self) -> tuple[int, int]:
        return exr_size(self.path)

    def __call__(self) -> np.ndarray:
        return read_exr(self.path)


@dataclass(frozen=True)
class _NpyFile:
    path: Path

    def size(self) -> tuple[int, ...]:
        return self._mapped().shape[::-1]

    def __call__(self) -> np.ndarray:
        return np.array(self._mapped())

    def _mapped(self) -> np.ndarray:
        """(H, W) numbers that are read when they are looked at."""
        check_regular(self.path)
        try:
            depth = np.load(self.path, allow_pickle=False, mmap_mode="r")
            if not isinstance(depth, np.ndarray) or depth.dtype.kind not in "fui":
                raise ValueError("it holds no array of numbers")
        except NUMPY_DAMAGE as error:
            raise InputError(f"{self.path} cannot be read as a depth map; replace it") from error
        shape = depth.shape
        while depth.ndim > 2 and 1 in depth.shape:
            depth = depth.squeeze(depth.shape.index(1))
        if depth.ndim != 2 or not 0 < depth.size <= MOST_DEPTH_PIXELS:
            raise InputError(f"{self.path} holds numbers of shape {shape}, which is no depth map; replace it")
        return depth
