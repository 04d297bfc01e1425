"""Where photos see the room's planes meet.

Where a wall ends at floor, ceiling and other walls each photo shows, however blank it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from room2dgs.geometry.camera import Camera

GAP = 2  # most pixels from one plane's last to another's first
MOST_ALONG = 0.5  # cosine between two planes whose crease is used
GRAZING = -0.03  # greatest n · ray of a plane that is seen
FULL = 30  # pixels of a crease from which on more of them count no more
# A crease is moved to the photo's edge beside it: among places up to so far, by how strong the edge is there and by how
# near it is; differences of grey values below the faintest say nothing.
BESIDE_PX, STEP_PX, REACH_PX, FAINT = 3.0, 0.25, 0.7, 0.02


class SeenPlanes(NamedTuple):
    """What one photo shows of the planes.

    Attributes:
        camera: of its size.
        grey: (h, w) float32 0..1, the photo.
        which: (h, w) int, the plane that each pixel shows; -1: none.
        sample, sample_weight: (h, w) metres, 0 = none, and weight 0..1: what stereo and the sparse points have there.
    """

    camera: Camera
    grey: np.ndarray
    which: np.ndarray
    sample: np.ndarray
    sample_weight: np.ndarray


class Creases(NamedTuple):
    """Pixels between two planes, of all photos.

    Attributes:
        planes: (N, 2) int.
        off: (N,) pixels from where the two meet.
        gain: (N, 2) pixels that are added to it for each metre that a plane comes nearer there, along its normal.
        at: (N, 3) metres, the place that the pixel shows, world frame.
        weight: (N,).
    """

    planes: np.ndarray
    off: np.ndarray
    gain: np.ndarray
    at: np.ndarray
    weight: np.ndarray


def creases_in(seen: Sequence[SeenPlanes], normals: np.ndarray, offsets: np.ndarray) -> Creases:
    """Of all photos.

    Args:
        normals, offsets: (P, 3) and (P,) metres, of the planes as `SeenPlanes` counts them, world frame.
    """
    none = Creases(np.zeros((0, 2), np.int64), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(0))
    parts = [creases_of(one, normals, offsets) for one in seen]
    return Creases(*(np.concatenate(part) for part in zip(none, *parts, strict=True)))


def creases_of(seen: SeenPlanes, normals: np.ndarray, offsets: np.ndarray) -> Creases:
    """Of one photo; likewise."""
    planes, pixel, across = _between(seen.which)
    meet = np.abs((normals[planes[:, 0]] * normals[planes[:, 1]]).sum(axis=1)) < MOST_ALONG
    planes, pixel, across = planes[meet], pixel[meet], across[meet]
    pixel = pixel + _to_the_edge(seen.grey, pixel, across)[:, None] * across
    camera = seen.camera
    rays = np.stack([camera.rays_at(pixel + step) @ camera.rotation for step in ((0, 0), (1, 0), (0, 1))], axis=1)
    facing = np.einsum("nrd,npd->nrp", rays, normals[planes])
    away = (offsets - normals @ camera.centre)[planes]
    # A ray meets both planes at once where away[0] / facing[0] = away[1] / facing[1].
    apart = away[:, :1] * facing[..., 1] - away[:, 1:] * facing[..., 0]
    slope = np.hypot(apart[:, 1] - apart[:, 0], apart[:, 2] - apart[:, 0])
    use = (facing[:, 0] < GRAZING).all(axis=1) & (slope > 1e-9)
    planes, away, facing, off, slope = planes[use], away[use], facing[use, 0], apart[use, 0], slope[use, None]
    gain = np.stack([facing[:, 1], -facing[:, 0]], axis=1) / slope
    at = camera.centre + rays[use, 0] * (away / facing).mean(axis=1, keepdims=True)
    _, alike, count = np.unique(np.sort(planes, axis=1), axis=0, return_inverse=True, return_counts=True)
    return Creases(planes, off / slope[:, 0], gain, at, 1 / np.maximum(count[alike.ravel()], FULL))


def _between(which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N, 2) planes, (N, 2) pixels between them, and (N, 2) the step of one pixel from the first to the second."""
    found = []
    for axis in (0, 1):
        turned = which if axis == 0 else which.T
        for gap in range(1, GAP + 1):
            first, second = turned[:-gap], turned[gap:]
            meet = (first >= 0) & (second >= 0) & (first != second)
            for inner in range(1, gap):
                meet &= turned[inner : inner - gap] < 0
            row, column = np.nonzero(meet)
            pixel = np.stack([column + 0.5, row + 0.5 + gap / 2], axis=1)
            step = np.broadcast_to([0.0, 1.0], pixel.shape)
            pair = np.stack([first[row, column], second[row, column]], axis=1)
            found.append((pair, pixel if axis == 0 else pixel[:, ::-1], step if axis == 0 else step[:, ::-1]))
    pairs, pixels, steps = zip(*found, strict=True)
    return np.concatenate(pairs), np.concatenate(pixels), np.concatenate(steps)


def _to_the_edge(grey: np.ndarray, pixel: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(N,) pixels along `across` from each pixel to the photo's edge beside it; 0 where there is none."""
    along = np.arange(-BESIDE_PX, BESIDE_PX + STEP_PX / 2, STEP_PX)
    lines = pixel[:, None] + along[:, None] * across[:, None] - 0.5
    beside = [lines + aside * across[:, None, ::-1] for aside in (-0.75, 0.0, 0.75)]
    seen = sum(map_coordinates(grey, place.T[::-1], order=1, mode="nearest").T for place in beside) / 3
    strength = (seen[:, 2:] - seen[:, :-2]) ** 2 * np.exp(-0.5 * (along[1:-1] / REACH_PX) ** 2)
    return (strength * along[1:-1]).sum(axis=1) / (strength.sum(axis=1) + FAINT**2)
