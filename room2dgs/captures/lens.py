"""Lens models (rays to pixels), and the pinhole camera that a distorted photo is resampled to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np

from room2dgs.errors import InputError

PINHOLES = {"PINHOLE": 4, "SIMPLE_PINHOLE": 3}
# Models of COLMAP and their number of parameters, focal lengths and principal point first.
MODELS = {
    **PINHOLES,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "FOV": 5,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
    "THIN_PRISM_FISHEYE": 12,
}
ONE_FOCAL = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")
FISHEYES = ("OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "FOV")
# A pinhole image of more than 120 degrees is mostly stretched border.
MAX_TANGENT = 1.7320508
BORDER_SAMPLES = 201
MAX_SIDE = 32768  # pixels; OpenCV remaps no larger image


@dataclass(frozen=True)
class Lens:
    """Intrinsics as a capture has them.

    Attributes:
        model: one of `MODELS`, as COLMAP defines them.
        params: of the model, in pixels; pixel centres at +0.5.
        size: (width, height) that they hold for; None: the photo's own.
        source: the file that they come from, for messages.
    """

    model: str
    params: tuple[float, ...]
    size: tuple[int, int] | None = None
    source: str = ""

    @property
    def K(self) -> np.ndarray:
        """(3, 3) float64 without the distortion."""
        if self.model in ONE_FOCAL:
            f, cx, cy = self.params[:3]
            fx = fy = f
        else:
            fx, fy, cx, cy = self.params[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def distorts(self) -> bool:
        """Whether a photo has to be undistorted. A fisheye does, whatever its coefficients."""
        if self.model in PINHOLES:
            return False
        return self.model in FISHEYES or any(self.params[3 if self.model in ONE_FOCAL else 4 :])

    @property
    def known_size(self) -> tuple[int, int]:
        """`size`, of a lens that has one: each has, once it is fitted to its photo."""
        assert self.size is not None, f"the lens of {self.source} has no size"
        return self.size

    def scaled_to(self, size: tuple[int, int]) -> Lens:
        """The same lens on a photo of another size; `size` must be known."""
        known = self.known_size
        sx, sy = size[0] / known[0], size[1] / known[1]
        if self.model in ONE_FOCAL:
            f, cx, cy, *rest = self.params
            return replace(self, params=(f * (sx + sy) / 2, cx * sx, cy * sy, *rest), size=size)
        fx, fy, cx, cy, *rest = self.params
        return replace(self, params=(fx * sx, fy * sy, cx * sx, cy * sy, *rest), size=size)

    def check(self) -> None:
        """Refuse what is no camera.

        Raises:
            InputError: an unknown model, a wrong number of parameters, or focal lengths that are not positive.
        """
        where = self.source or "the capture"
        if self.model not in MODELS:
            raise InputError(
                f"{where} has a camera of model {self.model[:40]!r}, which is not read; undistort the photos "
                f"(known: {', '.join(MODELS)})"
            )
        if len(self.params) != MODELS[self.model]:
            raise InputError(
                f"{where} gives {len(self.params)} parameters to a camera of model {self.model}; "
                f"it has {MODELS[self.model]}"
            )
        if self.size is not None and not all(0 < side < MAX_SIDE for side in self.size):
            raise InputError(f"{where} has a camera of {self.size[0]}x{self.size[1]} pixels; write its size again")
        focal = self.K[(0, 1), (0, 1)]
        if not np.isfinite(self.params).all() or not (focal > 0).all():
            raise InputError(f"{where} has no positive finite focal lengths; write the camera again")

    def project(self, rays: np.ndarray) -> np.ndarray:
        """(N, 2) pixels of directions (N, 3), camera frame, z = 1; NaN where there is none."""
        from room2dgs.colmap import pycolmap  # takes half a second to import

        return np.asarray(self._camera(pycolmap).img_from_cam(np.ascontiguousarray(rays, np.float64)))

    def rays_at(self, pixel: np.ndarray) -> np.ndarray:
        """(N, 2) directions (x, y, 1) through pixels (N, 2), camera frame."""
        from room2dgs.colmap import pycolmap

        return np.asarray(self._camera(pycolmap).cam_from_img(np.ascontiguousarray(pixel, np.float64)))

    def _camera(self, pycolmap: Any) -> Any:
        width, height = self.known_size
        return pycolmap.Camera(model=self.model, width=width, height=height, params=list(self.params))


class Pinhole(NamedTuple):
    """The pinhole image that a distorted photo is resampled to.

    Attributes:
        K: (3, 3) float64.
        size: (width, height).
        map_x, map_y: (H, W) float32, where the photo has each pixel; its first pixel's centre is 0.
        valid: (H, W) bool: the photo has this pixel; None: it has all.
    """

    K: np.ndarray
    size: tuple[int, int]
    map_x: np.ndarray
    map_y: np.ndarray
    valid: np.ndarray | None

    def undistorted(self, pixels: np.ndarray, nearest: bool = False) -> np.ndarray:
        """An image (H, W) or (H, W, C) of the lens's size, resampled."""
        how = cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR
        return cv2.remap(pixels, self.map_x, self.map_y, how, borderMode=cv2.BORDER_REPLICATE)


@lru_cache(maxsize=16)
def pinhole_of(lens: Lens) -> Pinhole:
    """The largest pinhole image inside a distorted one, at most as fine as it in its middle and in number of pixels.

    Its edges are those of the rectangle that the photo fills whole (COLMAP's without blank pixels), cut at 60
    degrees from the axis. So no pixel is invented; where a lens leaves holes even there, `valid` says so.

    Raises:
        InputError: the distortion leaves nothing.
    """
    lens.check()
    width, height = lens.known_size
    left, top, right, bottom = _whole_rectangle(lens)
    fx, fy = lens.K[0, 0], lens.K[1, 1]
    if not (right > left and bottom > top):
        raise _nothing_left(lens)
    shrink = min(1.0, width / (fx * (right - left)), height / (fy * (bottom - top)))
    fx, fy = fx * shrink, fy * shrink
    size = int(fx * (right - left) + 1e-6), int(fy * (bottom - top) + 1e-6)
    if min(size) < 16:
        raise _nothing_left(lens)
    K = np.array([[fx, 0.0, -left * fx], [0.0, fy, -top * fy], [0.0, 0.0, 1.0]])
    x, y = np.meshgrid((np.arange(size[0]) + 0.5) / fx + left, (np.arange(size[1]) + 0.5) / fy + top)
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    source = lens.project(rays).reshape(*x.shape, 2)
    valid = _seen_once(source, lens.known_size)
    if valid.mean() < 0.25:
        raise _nothing_left(lens)
    source = np.nan_to_num(source - 0.5, nan=-1.0, posinf=-1.0, neginf=-1.0).clip(-1.0, max(lens.known_size))
    map_x, map_y = np.ascontiguousarray(np.moveaxis(source, -1, 0), np.float32)
    return Pinhole(K, size, map_x, map_y, None if valid.all() else valid)


def _nothing_left(lens: Lens) -> InputError:
    return InputError(f"{lens.source} has a distortion that leaves nothing of the photo; check its coefficients")


def _whole_rectangle(lens: Lens) -> tuple[float, float, float, float]:
    """(left, top, right, bottom) on the plane z = 1, as the middle ray sees the photo's edges."""
    width, height = lens.known_size
    along = np.linspace(0.0, 1.0, BORDER_SAMPLES)
    zero, one = np.zeros_like(along), np.ones_like(along)
    edges = [(zero, along), (along, zero), (one, along), (along, one)]
    limits = []
    for edge, (x, y) in enumerate(edges):
        rays = lens.rays_at(np.stack([x * width, y * height], axis=1))
        axis = edge % 2
        values = rays[:, axis]
        # beyond 90 degrees a fisheye's border has no place on the plane
        side = values < 0 if edge < 2 else values > 0
        values = values[np.isfinite(values) & side]
        inner = MAX_TANGENT if not len(values) else min(MAX_TANGENT, float(np.abs(values).min()))
        limits.append(-inner if edge < 2 else inner)
    left, top, right, bottom = limits
    return left, top, right, bottom


def _seen_once(source: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W) bool: the map (H, W, 2) points into the photo, and does not fold over itself there."""
    with np.errstate(invalid="ignore"):
        inside = ((source >= -1e-3) & (source <= np.array(size) + 1e-3)).all(axis=-1)
        x_down, x_across = np.gradient(source[..., 0])
        y_down, y_across = np.gradient(source[..., 1])
        return inside & (x_across * y_down - x_down * y_across > 0)
