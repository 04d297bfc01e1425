"""Blocks of voxels, by their keys, in a table that grows in parts: nothing is copied, and little stays empty."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from room2dgs.geometry.cells import KEY_BASE, coordinates

BLOCK = 8  # voxels a block side
VOXELS = BLOCK**3
ROWS = 4096  # of a part, 12 kB each; those that nothing was written to take no memory
AROUND = np.array([(x * KEY_BASE + y) * KEY_BASE + z for x, y, z in product((-1, 0, 1), repeat=3)])


class Voxels(NamedTuple):
    """Attributes of blocks of voxels, a block a row, in the order z, y, x; float32, zeros where nothing was seen.

    Attributes:
        tsdf: (N, 512) mean distance in truncations, -1..1.
        weight: (N, 512).
        views: (N, 512) how many views have seen the voxel.
        color: (N, 1536) mean colour, 0..255.
    """

    tsdf: np.ndarray
    weight: np.ndarray
    views: np.ndarray
    color: np.ndarray


NUMBERS = (VOXELS, VOXELS, VOXELS, 3 * VOXELS)  # of a block: the widths of `Voxels`


class VoxelTable:
    """Blocks, in the order in which they were asked for.

    Attributes:
        keys: (N,) int64, rising.
        rows: (N,) int64, where each lies: in part row // ROWS, there at row % ROWS.
        parts: what the blocks hold.
    """

    def __init__(self) -> None:
        self.keys = self.rows = np.zeros(0, np.int64)
        self.parts: list[Voxels] = []

    def clear(self) -> None:
        """Forgets all blocks."""
        self.keys = self.rows = np.zeros(0, np.int64)
        self.parts = []

    def rows_of(self, keys: np.ndarray) -> np.ndarray:
        """(M,) int64 rows of blocks; those that are not there are added.

        Args:
            keys: (M,) int64, rising, none twice.
        """
        new = keys[~self.has(keys)]
        if len(new):
            known = len(self.keys)
            all_keys = np.concatenate([self.keys, new])
            order = np.argsort(all_keys, kind="stable")
            self.keys = all_keys[order]
            self.rows = np.concatenate([self.rows, np.arange(known, known + len(new))])[order]
            while len(self.parts) * ROWS < len(self.keys):
                self.parts.append(Voxels(*(np.zeros((ROWS, count), np.float32) for count in NUMBERS)))
        return self.rows[np.searchsorted(self.keys, keys)]

    def has(self, keys: np.ndarray) -> np.ndarray:
        """(M,) bool."""
        if not len(self.keys):
            return np.zeros(len(keys), bool)
        place = np.searchsorted(self.keys, keys).clip(max=len(self.keys) - 1)
        return self.keys[place] == keys

    def in_parts(self, keys: np.ndarray) -> Iterator[tuple[Voxels, np.ndarray, np.ndarray]]:
        """Each part that has some of these blocks, which of them (K,), and the rows (K,) there that they are in.

        Blocks that are not there are added.

        Args:
            keys: as in `rows_of`.
        """
        rows = self.rows_of(keys)
        for number in np.unique(rows // ROWS):
            which = np.flatnonzero(rows // ROWS == number)
            yield self.parts[number], which, rows[which] % ROWS

    def with_neighbours(self, keys: np.ndarray) -> np.ndarray:
        """Keys of these blocks and of all that touch them and are there; rising, none twice."""
        near = np.unique(keys[:, None] + AROUND)
        return near[self.has(near)]


def block_coordinates(keys: np.ndarray) -> np.ndarray:
    """(N, 3) int32 of blocks, from their keys."""
    return np.stack(coordinates(keys), axis=1).astype(np.int32)
