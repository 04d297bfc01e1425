"""Cells of a grid: which one a point falls into, and one number for each.

A cell's key is ((x + h) 2h + y + h) 2h + z + h with h = 2^20, so that keys rise with x, then y, then z; kernels that
find blocks of voxels write the same ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

KEY_BITS = 21  # of an index; three of them fit a signed 64-bit key
HALF_RANGE = 1 << (KEY_BITS - 1)  # cells on either side of the origin
KEY_BASE = 1 << KEY_BITS
Keys = TypeVar("Keys", np.ndarray, "Tensor")


def cell_indices(points: np.ndarray, side: float) -> np.ndarray:
    """(N, D) int64: the cell of each point (N, D), floor(point / side)."""
    return np.floor(points / side).astype(np.int64)


def keys_of(cells: np.ndarray) -> np.ndarray:
    """(N,) int64 keys of cells (N, 3), whole numbers from -2^20 to below 2^20."""
    x, y, z = (cells.astype(np.int64) + HALF_RANGE).T
    return (x * KEY_BASE + y) * KEY_BASE + z


def coordinates(keys: Keys) -> tuple[Keys, Keys, Keys]:
    """x, y and z of cells, from their keys: of an array or of a tensor."""
    return (
        keys // KEY_BASE**2 - HALF_RANGE,
        keys // KEY_BASE % KEY_BASE - HALF_RANGE,
        keys % KEY_BASE - HALF_RANGE,
    )


def cells_of(place: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """The cells that points fall into, in lexicographic order.

    As numpy.unique over rows, which compares these byte by byte and takes several times as long.

    Args:
        place: (N, D) coordinates.
        side: of a cell.

    Returns:
        (C,) each cell's first point, and (N,) each point's cell.
    """
    cell = cell_indices(place, side)
    order = np.lexsort(cell.T[::-1])
    ordered = cell[order]
    begins = np.ones(len(order), bool)
    begins[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    label = np.empty(len(order), np.int64)
    label[order] = np.cumsum(begins) - 1
    return order[begins], label
