"""The multi-resolution grid of the paper's growth: cells of edge delta, and coarser ones of 4 x 4 x 4 cells each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.geometry.cells import HALF_RANGE, KEY_BITS

RATIO_BITS = 2  # a level's edge is 4 times the next finer one's (Scaffold-GS: 16, 4 and 1 x delta)
MASK = (1 << KEY_BITS) - 1


class Cells(NamedTuple):
    """Items sorted into occupied cells.

    Attributes:
        keys: (C,) int64, rising.
        order: (M,) the items, cell after cell, in their own order inside a cell.
        first: (C,) where each cell's items begin in `order`.
        counts: (C,) items of each cell.
    """

    keys: np.ndarray
    order: np.ndarray
    first: np.ndarray
    counts: np.ndarray

    def mean(self, values: np.ndarray) -> np.ndarray:
        """(M, ...) one value an item to (C, ...) float64 means of each cell."""
        sums = np.add.reduceat(values[self.order].astype(np.float64), self.first, axis=0)
        return sums / self.counts.reshape(-1, *[1] * (values.ndim - 1))

    def only(self, chosen: np.ndarray) -> Cells:
        """The cells of a (C,) bool mask with their items."""
        counts = self.counts[chosen]
        first = np.cumsum(counts) - counts
        return Cells(self.keys[chosen], self.order[np.repeat(chosen, self.counts)], first, counts)


def cells_of(keys: np.ndarray) -> Cells:
    """Sort (M,) items by the cell that they lie in."""
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]])) if len(keys) else order
    return Cells(ordered[first], order, first, np.diff(np.append(first, len(keys))))


def level_edge(voxel_m: float, level: int, levels: int) -> float:
    """Metres; level 0 is the coarsest, level `levels` - 1 has cells of `voxel_m`."""
    return voxel_m * float(1 << (RATIO_BITS * (levels - 1 - level)))


def coarser(keys: np.ndarray, level: int, levels: int) -> np.ndarray:
    """Keys of the finest cells to the keys, likewise packed, of the cells of a level that hold them.

    Integer shifts: every fine cell lies in exactly one coarse cell, whatever the rounding of coordinates.
    """
    shift = RATIO_BITS * (levels - 1 - level)
    packed = np.zeros_like(keys)
    for place in (2 * KEY_BITS, KEY_BITS, 0):
        cell = ((keys >> place) & MASK) - HALF_RANGE
        packed |= ((cell >> shift) + HALF_RANGE) << place
    return packed


def in_grid(xyz: np.ndarray, voxel_m: float) -> np.ndarray:
    """(M,) bool: the point has a key (`voxelise.cell_keys` refuses the others)."""
    limit = HALF_RANGE * voxel_m
    return np.all((xyz >= -limit) & (xyz < limit), axis=1)
