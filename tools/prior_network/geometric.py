"""Crops, zooms, flips and rolls of a rendered view, with its depth, normals and intrinsics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.tools.prior_network.network import OUTPUT_STRIDE
from room2dgs.tools.prior_network.shards import NORMAL_UNIT, Sample

ZOOM = (0.6, 1.0)
ROLL_SHARE, ROLL_RAD = 0.3, 0.2
# blur before sampling at more than so many source pixels a pixel
ALIASING = 1.25


@dataclass(frozen=True)
class View:
    """Which part of a source image a training image shows.

    Attributes:
        linear: (2, 2) source pixels a target pixel: turn, flip and zoom in one.
        offset: (2,) source pixel of the target's corner; centres at +0.5.
        mirrored: x is flipped.
        roll: radians.
        scale: source pixels a target pixel.
    """

    linear: np.ndarray
    offset: np.ndarray
    mirrored: bool
    roll: float
    scale: float


class Seen(NamedTuple):
    """A training image before the photographic effects.

    Attributes:
        radiance: (H, W, 3) uint8, coded as on disk.
        depth: (H / OUTPUT_STRIDE, W / OUTPUT_STRIDE) metres, 0 = invalid.
        normal: (H / OUTPUT_STRIDE, W / OUTPUT_STRIDE, 3) unit, 0 = invalid.
        intrinsics: (3, 3) in pixels of the image, centres at +0.5.
    """

    radiance: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    intrinsics: np.ndarray


def random_view(source: tuple[int, int], size: tuple[int, int], rng: np.random.Generator) -> View:
    """A random zoom, place, flip and sometimes roll; source and size are (width, height)."""
    zoom = rng.uniform(*ZOOM)
    shift = rng.uniform(-1.0, 1.0, 2)
    mirrored = bool(rng.random() < 0.5)
    roll = float(rng.uniform(-ROLL_RAD, ROLL_RAD)) if rng.random() < ROLL_SHARE else 0.0
    return view_of(source, size, zoom, shift, mirrored, roll)


def view_of(
    source: tuple[int, int],
    size: tuple[int, int],
    zoom: float = 1.0,
    shift: np.ndarray | tuple[float, float] = (0.0, 0.0),
    mirrored: bool = False,
    roll: float = 0.0,
) -> View:
    """The view of the largest crop of size's aspect times `zoom`.

    Args:
        source, size: (width, height) of the source and of the target.
        zoom: side of the crop over the largest side that fits.
        shift: (2,) -1 to 1, the crop's place between the borders; (0, 0) is the middle.
        mirrored, roll: see View.
    """
    source_size, target_size = np.array(source, float), np.array(size, float)
    scale = float(zoom * (source_size / target_size).min())
    middle = source_size / 2.0 + np.asarray(shift) * (source_size - scale * target_size) / 2.0
    cos, sin = np.cos(roll), np.sin(roll)
    linear = scale * np.array([[cos, -sin], [sin, cos]]) @ np.diag([-1.0 if mirrored else 1.0, 1.0])
    return View(linear, middle - linear @ (target_size / 2.0), mirrored, roll, scale)


def seen_in(sample: Sample, view: View, size: tuple[int, int]) -> Seen:
    """Resamples a sample to `size` (width, height); beyond its border the photo is mirrored, the truth invalid."""
    height, width = sample.depth.shape
    radiance = np.ascontiguousarray(sample.radiance)
    if view.scale > ALIASING:
        sigma = 0.4 * np.sqrt(view.scale**2 - 1.0)
        radiance = cv2.GaussianBlur(radiance, (5, 5), sigma)
    # cv2 counts pixels from their centres
    offset = view.offset + view.linear @ (0.5, 0.5) - 0.5
    affine = np.concatenate([view.linear, offset[:, None]], axis=1)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    radiance = cv2.warpAffine(radiance, affine, size, flags=flags, borderMode=cv2.BORDER_REFLECT_101)

    columns = (np.arange(size[0] // OUTPUT_STRIDE) + 0.5) * OUTPUT_STRIDE
    rows = (np.arange(size[1] // OUTPUT_STRIDE) + 0.5) * OUTPUT_STRIDE
    x = view.linear[0, 0] * columns[None] + view.linear[0, 1] * rows[:, None] + view.offset[0]
    y = view.linear[1, 0] * columns[None] + view.linear[1, 1] * rows[:, None] + view.offset[1]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    at = (np.clip(y, 0, height - 1).astype(np.intp), np.clip(x, 0, width - 1).astype(np.intp))
    depth = np.where(inside, sample.depth[at].astype(np.float32), np.float32(0.0))
    coded = np.where(inside[..., None], sample.normal[at], 0)
    return Seen(radiance, depth, _turned_normals(coded, view), _intrinsics(sample, view))


def _turned_normals(coded: np.ndarray, view: View) -> np.ndarray:
    """(h, w, 3) int8 source normals -> unit normals in the target's camera; 0 stays 0."""
    normal = coded.astype(np.float32) / np.float32(NORMAL_UNIT)
    cos, sin = np.float32(np.cos(view.roll)), np.float32(np.sin(view.roll))
    x = cos * normal[..., 0] + sin * normal[..., 1]
    y = cos * normal[..., 1] - sin * normal[..., 0]
    turned = np.stack([-x if view.mirrored else x, y, normal[..., 2]], axis=-1)
    length = np.sqrt((turned * turned).sum(axis=-1, keepdims=True))
    return turned / np.maximum(length, np.float32(1e-6))


def _intrinsics(sample: Sample, view: View) -> np.ndarray:
    """The target's: the principal point goes where the source's is seen."""
    height, width = sample.depth.shape
    principal = np.linalg.solve(view.linear, np.array([width / 2.0, height / 2.0]) - view.offset)
    focal = sample.focal / view.scale
    return np.array([[focal, 0.0, principal[0]], [0.0, focal, principal[1]], [0.0, 0.0, 1.0]], dtype=np.float32)
