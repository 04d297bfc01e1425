"""What stereo's rays have passed through: a depth that puts a surface there is wrong.

Views that stand side by side share the mistakes of their network, and then agree on them. Views from elsewhere look
through such a surface at what lies behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from room2dgs import _C
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points

CELL_M = 0.05
MOST_CELLS = 2**25  # larger cells where a room would need more
LEAST_TRUST = 0.25  # of a point whose ray counts
FROM_M = 0.1  # from the camera on
UP_TO = 0.95  # of the way to the point
OUTSIDE = 0.001  # share of the ends on each side that the cells leave out: those far beyond a window
MARGIN_M = 0.3
DOUBT = 2  # views that one view has to be more than


class FreeSpace(NamedTuple):
    """Cells of a box.

    Attributes:
        corner: (3,) metres, world frame.
        cell: metres.
        through: (X, Y, Z) int16, how many views look through the cell at something behind it.
        ended: (X, Y, Z) int16, how many views see a surface in the cell or in one of its 26 neighbours.
    """

    corner: np.ndarray
    cell: float
    through: np.ndarray
    ended: np.ndarray


class Rays(NamedTuple):
    """From a camera's centre, (3,), to the points that it sees, (N, 3), metres, world frame."""

    centre: np.ndarray
    ends: np.ndarray


def rays_to(points: PointCloud, frame: Frame) -> Rays:
    """To the points that a photo sees and that can be trusted."""
    index = seen_points(points, frame).index
    return Rays(frame.camera.centre, points.xyz[index[points.weight_of(index) >= LEAST_TRUST]])


def free_space(views: Sequence[Rays]) -> FreeSpace | None:
    """Counted over all views, on any number of threads the same; None if no ray has an end."""
    ends = np.concatenate([view.ends for view in views]) if views else np.zeros((0, 3))
    if not len(ends):
        return None
    low, high = np.quantile(ends, (OUTSIDE, 1 - OUTSIDE), axis=0)
    centres = [view.centre for view in views]
    low, high = np.min([low, *centres], axis=0), np.max([high, *centres], axis=0)
    corner, size = low - MARGIN_M, high - low + 2 * MARGIN_M
    cell = max(CELL_M, float(np.prod(size) / MOST_CELLS) ** (1 / 3))
    shape = tuple(int(count) for count in np.ceil(size / cell))
    through, ended = np.zeros(shape, np.int16), np.zeros(shape, np.int16)
    with ThreadPoolExecutor(_C.threads()) as pool:
        for passed, met in pool.map(partial(_cells, corner=corner, cell=cell, shape=shape), views):
            through.ravel()[passed] += 1
            ended.ravel()[met] += 1
    return FreeSpace(corner, cell, through, maximum_filter(ended, 3, mode="constant"))


def less_where_seen_through(points: PointCloud, space: FreeSpace | None) -> PointCloud:
    """The points, less trusted the more views look through them."""
    weight = points.weight_of(np.arange(len(points))) * (1 - seen_through(space, points.xyz)) ** 2
    return replace(points, weight=weight.astype(np.float32))


def seen_through(space: FreeSpace | None, xyz: np.ndarray) -> np.ndarray:
    """Share of the views' word that there is nothing at a point, 0..1; 0 where no view says anything.

    Args:
        xyz: (..., 3) metres, world frame.
    """
    if space is None:
        return np.zeros(xyz.shape[:-1])
    place = np.floor((xyz - space.corner) / space.cell)
    inside = ((place >= 0) & (place < space.through.shape)).all(axis=-1)
    at = tuple(np.moveaxis(np.where(inside[..., None], place, 0).astype(np.int64), -1, 0))
    ended = np.where(inside, space.ended[at], 0)
    against = np.maximum(np.where(inside, space.through[at], 0) - ended, 0.0)
    return against / (against + DOUBT + ended)


def _cells(view: Rays, corner: np.ndarray, cell: float, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Flat indices of the cells that a view looks through, and of those where its rays end, each once."""
    met = np.unique(_flat((view.ends - corner) / cell, shape))
    start, reach = (view.centre - corner) / cell, (view.ends - view.centre) / cell
    length = np.linalg.norm(reach, axis=1)
    reach = reach[length > 0] / length[length > 0, None]
    length = UP_TO * length[length > 0]
    passed = np.zeros(int(np.prod(shape)), bool)
    for step in np.arange(FROM_M / cell, length.max(initial=0), 1.0):
        on = length > step
        reach, length = reach[on], length[on]
        passed[_flat(start + step * reach, shape)] = True
    return np.flatnonzero(passed), met


def _flat(place: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Of places in cells; those outside are left out."""
    inside = ((place >= 0) & (place < shape)).all(axis=1)
    return np.ravel_multi_index(tuple(place[inside].astype(np.int64).T), shape)
