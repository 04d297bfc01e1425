"""What stereo's rays have passed through: a depth that puts a surface there is wrong.

Views that stand side by side share the mistakes of their network, and then agree on them. Views from elsewhere look
through such a surface at what lies behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from room2dgs import _C
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points

CELL_M = 0.05
MOST_CELLS = 2**25  # larger cells where a room would need more
LEAST_WEIGHT = 0.25  # of a point whose ray counts
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
        through: (X, Y, Z) int32, how many views look through the cell at something behind it.
        ended: (X, Y, Z) int32, how many views see a surface in the cell or in one of its 26 neighbours.
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
    """To the points that a photo sees and that weigh enough."""
    index = seen_points(points, frame).index
    return Rays(frame.camera.centre, points.xyz[index[points.weight_of(index) >= LEAST_WEIGHT]])


def free_space(views: Sequence[Rays]) -> FreeSpace | None:
    """Counted over all views, on any number of threads the same; None if no ray has an end."""
    ends = np.concatenate([view.ends for view in views], dtype=np.float64) if views else np.zeros((0, 3))
    if not len(ends):
        return None
    low, high = np.quantile(ends, (OUTSIDE, 1 - OUTSIDE), axis=0)
    centres = [view.centre for view in views]
    low, high = np.min([low, *centres], axis=0), np.max([high, *centres], axis=0)
    corner, size = low - MARGIN_M, high - low + 2 * MARGIN_M
    cell = max(CELL_M, float(np.prod(size) / MOST_CELLS) ** (1 / 3))
    shape = tuple(int(count) for count in np.ceil(size / cell))
    through, ended = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    first = np.cumsum([0, *(len(view.ends) for view in views)])
    _C.count_rays(corner, cell, np.array(centres, np.float64), first, ends, FROM_M, UP_TO, through, ended)
    return FreeSpace(corner, cell, through, maximum_filter(ended, 3, mode="constant"))


def less_where_seen_through(points: PointCloud, space: FreeSpace | None) -> PointCloud:
    """The points, of less weight the more views look through them."""
    weight = points.weight_of(np.arange(len(points))) * (1 - seen_through(space, points.xyz)) ** 2
    return replace(points, weight=weight.astype(np.float32))


def seen_through(space: FreeSpace | None, xyz: np.ndarray) -> np.ndarray:
    """Share of the views by which there is nothing at a point, 0..1; 0 where no view sees it.

    Args:
        xyz: (..., 3) metres, world frame.
    """
    if space is None:
        return np.zeros(xyz.shape[:-1])
    share = np.empty(xyz.shape[:-1])
    points = np.ascontiguousarray(xyz, np.float64).reshape(-1, 3)
    _C.seen_through(space.corner, space.cell, space.through, space.ended, points, float(DOUBT), share.reshape(-1))
    return share
