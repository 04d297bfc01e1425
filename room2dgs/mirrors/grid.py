"""A grid on a wall, and what the ways that cross its cells end at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.mirrors.sights import Sights
from room2dgs.mirrors.walls import Plane

CELL_M = 0.1
BEFORE_M, BEHIND_M = 0.1, 0.15  # of cameras before a plane, and of what is behind it and not on it
ON_M, ON = 0.04, 0.02  # of what is on it: metres, and of the distance from the camera
MARGIN = 3  # cells around those that are seen through
LARGEST = 400  # cells along a side


class WallGrid(NamedTuple):
    """What is seen through a plane and on it.

    Attributes:
        plane: the plane.
        axes: (2, 3) unit, along its sides; the second one is the more upright.
        low: (2,) metres along the axes, of the first cell's corner.
        number: (B,) of the sights that end behind it.
        past_m: (B,) how far behind.
        cell: (B, 2) int, where they cross it.
        crossed, stopped: (R, C) number of sights through each cell that end behind it, and on it.
    """

    plane: Plane
    axes: np.ndarray
    low: np.ndarray
    number: np.ndarray
    past_m: np.ndarray
    cell: np.ndarray
    crossed: np.ndarray
    stopped: np.ndarray

    def counted(self, which: np.ndarray) -> np.ndarray:
        """(R, C) how many of these of the B sights cross each cell."""
        return _counted(self.cell[which], self.crossed.shape)


def grid_on(plane: Plane, sights: Sights, up: np.ndarray) -> WallGrid | None:
    """None where nothing is seen behind the plane.

    Args:
        up: (3,) unit.
    """
    away = sights.centre @ plane.normal - plane.offset_m
    past = plane.offset_m - sights.point @ plane.normal
    axes = _axes(plane.normal, up)
    behind = np.flatnonzero((away > BEFORE_M) & (past > BEHIND_M))
    if not len(behind):
        return None
    share = away[behind] / (away[behind] + past[behind])
    start, end = sights.centre[behind] @ axes.T, sights.point[behind] @ axes.T
    place = start + share[:, None] * (end - start)
    low = place.min(axis=0) - MARGIN * CELL_M
    size = np.minimum(np.ceil((place.max(axis=0) - low) / CELL_M).astype(np.int64) + MARGIN, LARGEST)
    cell, inside = _cells(place, low, size)
    near = np.flatnonzero((away > BEFORE_M) & (np.abs(past) < np.maximum(ON_M, ON * sights.distance)))
    on, fits = _cells(sights.point[near] @ axes.T, low, size)
    counts = _counted(cell[inside], size), _counted(on[fits], size)
    return WallGrid(plane, axes, low, behind[inside], past[behind][inside], cell[inside], *counts)


def _cells(place: np.ndarray, low: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    cell = np.floor((place - low) / CELL_M).astype(np.int64)
    column, row = cell.T
    return cell, (column >= 0) & (row >= 0) & (column < size[0]) & (row < size[1])


def _counted(cell: np.ndarray, size: np.ndarray | tuple[int, ...]) -> np.ndarray:
    rows, columns = (int(one) for one in size)
    return np.bincount(cell[:, 0] * columns + cell[:, 1], minlength=rows * columns).reshape(rows, columns)


def _axes(normal: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(2, 3) unit, square to a normal; the first is level where the normal is not upright itself."""
    if abs(normal @ up) > 0.8:
        up = np.eye(3)[np.abs(normal).argmin()]
    level = np.cross(up, normal)
    level = level / np.linalg.norm(level)
    return np.stack([level, np.cross(normal, level)])
