"""Which vertices of a raw surface lie where views have measured, and which between such places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.geometry.cells import keys_of
from room2dgs.mesh.voxel_table import BLOCK, VOXELS, VoxelTable

MOST = 255


@dataclass(frozen=True)
class SeenVoxels:
    """How many views have seen each voxel of a table, in little memory.

    Attributes:
        keys: (N,) int64 of the blocks, rising.
        views: (N, 512) uint8, in the order z, y, x; at most 255.
        origin: (3,) metres, world, of the volume.
        voxel_m: side of a voxel, metres.
    """

    keys: np.ndarray
    views: np.ndarray
    origin: np.ndarray
    voxel_m: float

    def at(self, vertices: np.ndarray) -> np.ndarray:
        """(V,) uint8: how many views have seen both voxels that each vertex lies between.

        Args:
            vertices: (V, 3) metres, world, of an isosurface: each on the line between two neighbouring voxels.
        """
        place = (vertices - self.origin) / self.voxel_m
        nearest = np.round(place)
        # vertices of a volume in float32 do not lie quite on the lines between voxels
        place = np.where(np.abs(place - nearest) < 1e-3, nearest, place)
        return np.minimum(self._voxel(np.floor(place)), self._voxel(np.ceil(place)))

    def _voxel(self, voxel: np.ndarray) -> np.ndarray:
        voxel = voxel.astype(np.int64)
        block = voxel // BLOCK
        key = keys_of(block)
        x, y, z = (voxel - block * BLOCK).T
        row = np.searchsorted(self.keys, key).clip(max=len(self.keys) - 1)
        return np.where(self.keys[row] == key, self.views[row, (z * BLOCK + y) * BLOCK + x], 0)


def seen_voxels(table: VoxelTable, origin: np.ndarray, voxel_m: float) -> SeenVoxels:
    """What a table's views have seen, before it is made smooth."""
    views = np.empty((len(table.keys), VOXELS), np.uint8)
    for part, which, at in table.in_parts(table.keys):
        views[which] = np.where(part.weight[at] > 0, np.minimum(part.views[at], MOST), 0)
    return SeenVoxels(table.keys.copy(), views, origin, voxel_m)
