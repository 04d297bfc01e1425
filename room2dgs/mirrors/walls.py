"""Flat parts of a room, from depth maps: a mirror hangs on one, or has a frame that is one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.mirrors.sights import SmallView

STEP = 4  # pixels between those whose normals are asked
DRAWS, MOST = 40, 16  # planes that are tried for each, and that are found
LEAST = 50  # pixels that are left
TILT, OFF_M = 0.985, 0.03  # cosine of normals, and distance, within which pixels are of a plane
WIDER_TILT, WIDER_M = 0.96, 0.05  # and are not asked again


class Plane(NamedTuple):
    """normal @ point = offset_m; the normal is towards the room."""

    normal: np.ndarray
    offset_m: float


def walls_of(views: Sequence[SmallView]) -> list[Plane]:
    """Up to `MOST` planes, roughly the largest first."""
    point, normal, area = (np.concatenate(part) for part in zip(*map(_facets, views), strict=True))
    if not len(area):
        return []
    area = np.minimum(area, np.percentile(area, 95))  # of a grazing pixel
    left, random = np.ones(len(area), bool), np.random.default_rng(0)
    found: list[Plane] = []
    while len(found) < MOST and left.sum() > LEAST:
        index = np.flatnonzero(left)
        drawn = random.choice(index, DRAWS, p=area[index] / area[index].sum())
        on = [_on(Plane(normal[one], point[one] @ normal[one]), point, normal, left, TILT, OFF_M) for one in drawn]
        best = max(range(DRAWS), key=lambda one: area[on[one]].sum())
        plane = _fitted(on[best], point, normal, area)
        left &= ~_on(plane, point, normal, left, WIDER_TILT, WIDER_M)
        left[drawn[best]] = False
        found.append(plane)
    return found


def _facets(view: SmallView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (N, 3), unit normals (N, 3) towards the camera and areas (N,), of every so many pixels."""
    half = STEP // 2
    point = view.camera.centre + view.camera.world_rays() * view.depth[..., None]
    rows, columns = (np.arange(half, size - half, STEP) for size in view.depth.shape)
    at, right, below = (
        (point[np.ix_(rows + down, columns + across)], view.depth[np.ix_(rows + down, columns + across)])
        for down, across in ((0, 0), (0, half), (half, 0))
    )
    normal = np.cross(right[0] - at[0], below[0] - at[0])
    length = np.linalg.norm(normal, axis=-1)
    known = (at[1] > 0) & (right[1] > 0) & (below[1] > 0) & (length > 0)
    start, normal, length = at[0][known], normal[known], length[known]
    normal = normal / length[:, None]
    towards = np.where(((view.camera.centre - start) * normal).sum(axis=1) > 0, 1.0, -1.0)
    return start, normal * towards[:, None], length


def _on(
    plane: Plane, point: np.ndarray, normal: np.ndarray, among: np.ndarray, tilt: float, off_m: float
) -> np.ndarray:
    return among & (normal @ plane.normal > tilt) & (np.abs(point @ plane.normal - plane.offset_m) < off_m)


def _fitted(on: np.ndarray, point: np.ndarray, normal: np.ndarray, area: np.ndarray) -> Plane:
    across = area[on] @ normal[on]
    across = across / np.linalg.norm(across)
    return Plane(across, float(np.average(point[on] @ across, weights=area[on])))
