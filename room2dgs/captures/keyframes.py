"""Chooses the photos that depth and normals are computed for, where neighbours see nearly the same."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera

LEAST_VIEWS = 3  # that see each other: two others must agree with a depth


def keyframes(cameras: Sequence[Camera], share: float) -> list[int]:
    """Indices, ascending, of a share of the cameras that stand and look as differently as can be.

    The first is taken first, then always the one that is farthest from those that are taken. Distances and angles count
    in units of what lies between neighbouring cameras, so that the scene's scale does not matter.

    Args:
        share: 0..1 of the cameras; at least `LEAST_VIEWS` are taken.
    """
    count = max(LEAST_VIEWS, math.ceil(share * len(cameras)))
    if count >= len(cameras):
        return list(range(len(cameras)))
    centres = np.stack([camera.centre for camera in cameras])
    rotations = np.stack([camera.cam_from_world[:3, :3] for camera in cameras])

    def between(one: int) -> tuple[np.ndarray, np.ndarray]:
        trace = np.einsum("ij,vij->v", rotations[one], rotations)
        return np.linalg.norm(centres - centres[one], axis=1), np.arccos(((trace - 1) / 2).clip(-1, 1))

    pairs = [between(one) for one in range(len(cameras))]
    units = [_to_the_nearest(np.stack(part)) for part in zip(*pairs, strict=True)]
    apart = [np.hypot(*(part / unit for part, unit in zip(pair, units, strict=True))) for pair in pairs]
    taken, nearest = [0], apart[0]
    while len(taken) < count:
        nearest[taken] = -1.0  # cameras may lie in one place
        taken.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, apart[taken[-1]])
    return sorted(taken)


def _to_the_nearest(apart: np.ndarray) -> float:
    """What usually lies between a view and the one nearest to it; 1 if nothing does."""
    np.fill_diagonal(apart, np.inf)
    usual = float(np.median(apart.min(axis=1)))
    return usual if usual > 1e-9 else 1.0
