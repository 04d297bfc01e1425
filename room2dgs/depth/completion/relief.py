"""By how much the parts of a large plane lie before or behind it, by what stereo finds there.

A wall is flat to the millimetre from one photo's noise to the next, but not to the centimetre from end to end: a panel
or a recess beside it takes the whole plane with it. What all views' stereo has in one place of a wall is right to a
centimetre, though single pixels are off by five.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from room2dgs import _C
from room2dgs.geometry.rotations import across_of

if TYPE_CHECKING:
    from room2dgs.depth.completion.planes import Plane

CELL_M = 0.2
MOST_CELLS = 10_000  # larger cells where a plane would need more
REACH_M = 0.06  # farther off a plane lies something else
FACING = 0.9  # least cosine between the normals of an anchor and of the plane
LEAST_TRUST = 0.2  # of an anchor
FEWEST_ANCHORS, FEWEST_VIEWS = 8, 2  # that speak for a cell
ALIKE = 8.0  # views whose errors count as one: neighbours mistake the same thing alike
FLOOR_M = 0.004  # error of any cell
BY_DEPTH = 0.004  # error of a view's cell, relative to its depth, however well its pixels agree
STEP_M = 0.006  # usual difference between cells side by side
FLAT_M = 0.13  # usual height of a cell of which nothing is known but that it lies on the plane
WRONG_M = 0.05  # what a cell's height is off by at which it starts to count as wrong
BREAK_M = 0.006  # difference between cells side by side at which the tie between them starts to break
REWEIGHTINGS, LEAST = 4, 1e-7
FEWEST_ON_PLANE = 50


class Relief(NamedTuple):
    """Heights over a plane, on its normal's side.

    Attributes:
        across: (2, 3) unit vectors along the plane, world frame.
        corner: (2,) metres along them, of the first cell's corner.
        cell: metres.
        height: (h, w) float32 metres, along the first and the second vector.
    """

    across: np.ndarray
    corner: np.ndarray
    cell: float
    height: np.ndarray

    def at(self, xyz: np.ndarray) -> np.ndarray:
        """(h, w) metres, over the places of the plane that are nearest to (h, w, 3) points; beyond its cells that of
        the last one."""
        rows, columns = self.height.shape
        row, column = (
            (((_along(xyz, axis) - low) / self.cell - 0.5).clip(0, count - 1)).astype(np.float32)
            for axis, low, count in zip(self.across, self.corner, (rows, columns), strict=True)
        )
        return cv2.remap(self.height, column, row, cv2.INTER_LINEAR)


class Anchors(NamedTuple):
    """Stereo's pixels as points of all views.

    Attributes:
        xyz: (N, 3) metres, world frame.
        normal: (N, 3) unit, world frame, towards the camera: the prior's.
        depth: (N,) metres, from the camera that saw it.
        trust: (N,) 0..1.
        view: (N,) int, which one saw it.
    """

    xyz: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    trust: np.ndarray
    view: np.ndarray


def with_reliefs(planes: Sequence[Plane], anchors: Anchors) -> list[Plane]:
    """The planes, each with a relief where enough anchors lie on it; the same input gives the same bits.

    An anchor speaks for the plane that it is nearest to. A cell's height is the weighted median of its anchors, known
    as well as they and the views agree. Heights of cells side by side are tied to each other, and weakly to the plane;
    ties break where the height jumps (Geman and McClure), as in `solve`, whose kernel this is.
    """
    away = np.full((len(planes), len(anchors.xyz)), np.inf)
    for row, plane in zip(away, planes, strict=True):
        facing = _along(anchors.normal, plane.normal) > FACING
        row[facing] = _along(anchors.xyz[facing], plane.normal) - plane.offset
    nearest = np.abs(away).argmin(axis=0) if len(planes) else np.zeros(0, np.int64)
    found = []
    for index, (plane, height) in enumerate(zip(planes, away, strict=True)):
        on = (nearest == index) & (np.abs(height) < REACH_M) & (anchors.trust >= LEAST_TRUST)
        enough = np.count_nonzero(on) >= FEWEST_ON_PLANE
        some = Anchors(*(part[on] for part in anchors))
        found.append(plane._replace(relief=_relief(plane.normal, some, height[on])) if enough else plane)
    return found


def _relief(normal: np.ndarray, on: Anchors, height: np.ndarray) -> Relief:
    across = across_of(normal)
    place = np.stack([_along(on.xyz, axis) for axis in across], axis=1)
    corner, size = place.min(axis=0), np.ptp(place, axis=0)
    cell = max(CELL_M, float(np.prod(size + CELL_M) / MOST_CELLS) ** 0.5)
    shape = tuple(int(count) for count in size // cell + 1)
    row, column = ((place - corner) // cell).astype(np.int64).T
    median, precision = _cells(row * shape[1] + column, on, height, shape[0] * shape[1])
    tie, flat = STEP_M**-2 * np.ones(shape), FLAT_M**-2 * np.ones(shape)
    solved = np.empty((1, *shape))
    ties = tie[:, 1:], tie[1:]
    given = (median.reshape(shape), precision.reshape(shape), flat, *ties, *(0 * one for one in ties))
    _C.complete(*(np.ascontiguousarray(one[None]) for one in given), REWEIGHTINGS, LEAST, WRONG_M, BREAK_M, solved)
    return Relief(across, corner, cell, solved[0].astype(np.float32))


def _cells(cell: np.ndarray, on: Anchors, height: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Weighted median height of each cell's anchors, metres, 0 = too few, and 1 over its squared error."""
    order = np.lexsort((height, cell))
    cell, height = cell[order], height[order]
    trust, depth, view = on.trust[order], on.depth[order], on.view[order]
    weight = trust / np.maximum(depth, 1.0) ** 2
    summed = np.cumsum(weight)
    before = np.concatenate([[0.0], summed])[np.searchsorted(cell, np.arange(count))]
    total = np.bincount(cell, weight, count)

    def quantile(share: float) -> np.ndarray:
        return height[np.minimum(np.searchsorted(summed, before + share * total), len(height) - 1)]

    anchors = np.bincount(cell, minlength=count)
    seen_by = np.unique(cell * (int(view.max()) + 1) + view) // (int(view.max()) + 1)
    views = np.bincount(seen_by, minlength=count)
    known = (anchors >= FEWEST_ANCHORS) & (views >= FEWEST_VIEWS)
    scatter = 0.5 * (quantile(0.84) - quantile(0.16))
    by_depth = BY_DEPTH * np.bincount(cell, depth, count) / np.maximum(anchors, 1)
    variance = (scatter**2 + by_depth**2) * ALIKE / np.maximum(views, 1) + FLOOR_M**2
    return np.where(known, quantile(0.5), 0.0), np.where(known, 1 / variance, 0.0)


def _along(vectors: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return (vectors * axis).sum(axis=-1)  # not BLAS, whose bits depend on its threads
