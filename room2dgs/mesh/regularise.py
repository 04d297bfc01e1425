"""Signed distances made one smooth field: what few views say, or none, follows from what is around it.

The field minimises sum_v w_v / 2 (u_v - f_v)^2 + SHARE sum_v h(|grad u_v|): f is the mean of what views say of voxel v,
w how much they count, h Huber's norm. Total variation keeps edges and leaves the smallest surface between what is known
(Zach, Pock and Bischof 2007); the quadratic part leaves no steps. Solved from coarse to fine by the primal-dual
method of Chambolle and Pock 2011; the kernel is in csrc/regularise_kernels.cpp.
"""

from __future__ import annotations

import numpy as np

from room2dgs import _C
from room2dgs.geometry.cells import KEY_BASE
from room2dgs.mesh.voxel_table import BLOCK, VoxelTable

SHARE, SOFT = 0.05, 0.3
# Of a voxel, in medians of those near a surface: one view's surface is not to vanish beside what many have seen, and
# many that err alike are not many words.
SMALLEST_WEIGHT, LARGEST_WEIGHT = 0.5, 3.0
STEPS = {1: 40, 2: 40, 4: 100, 8: 120}  # by the voxels a block side
OFFSETS = np.array([-(KEY_BASE**2), -KEY_BASE, -1, KEY_BASE**2, KEY_BASE, 1])  # of keys, at -x, -y, -z, +x, +y, +z


def regularise(table: VoxelTable, min_weight: float) -> None:
    """Write the smooth field to all voxels of a table, each of which then counts.

    Args:
        table: its `tsdf` and `weight` are replaced.
        min_weight: what fewer views have seen is not known.
    """
    if not len(table.keys):
        return
    data, weight = (np.empty((len(table.keys), BLOCK**3), np.float32) for _ in range(2))
    for part, which, at in table.in_parts(table.keys):
        data[which] = part.tsdf[at]
        weight[which] = np.where(part.views[at] < min_weight, 0, part.weight[at])
    near = (weight > 0) & (np.abs(data) < 1)
    if not near.any():
        return
    relative = (weight / np.median(weight[near])).clip(SMALLEST_WEIGHT, LARGEST_WEIGHT)
    weight = np.where(weight > 0, relative, 0).astype(np.float32)
    field = solved(data, weight, neighbours(table.keys))
    for part, which, at in table.in_parts(table.keys):
        part.tsdf[at] = field[which]
        part.weight[at] = 1
        part.views[at] = np.maximum(part.views[at], min_weight)


def solved(data: np.ndarray, weight: np.ndarray, around: np.ndarray) -> np.ndarray:
    """(N, 512) float32: the field.

    Args:
        data, weight: (N, 512) float32.
        around: (N, 6) int32, as `neighbours`.
    """
    levels = [(data, weight)]
    while levels[-1][0].shape[1] > 1:
        levels.append(_halved(*levels[-1]))
    value = np.zeros_like(levels[-1][0])
    for mean, counts in reversed(levels):
        side = round(mean.shape[1] ** (1 / 3))
        value = _doubled(value) if value.shape != mean.shape else value
        ahead, dual = value.copy(), np.zeros((len(mean), 3, mean.shape[1]), np.float32)
        _C.regularise(mean, counts, around, value, ahead, dual, side, SHARE, SOFT, STEPS[side])
    return value


def neighbours(keys: np.ndarray) -> np.ndarray:
    """(N, 6) int32: which block lies at -x, -y, -z, +x, +y, +z of each, -1 where none is.

    Args:
        keys: (N,) int64 of blocks, rising.
    """
    wanted = keys[:, None] + OFFSETS
    place = np.searchsorted(keys, wanted).clip(max=len(keys) - 1)
    return np.where(keys[place] == wanted, place, -1).astype(np.int32)


def _halved(data: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over 2 x 2 x 2 voxels."""
    total, value = _sums(weight), _sums(weight * data)
    return value / np.maximum(total, np.float32(1e-12)), total / 8


def _sums(values: np.ndarray) -> np.ndarray:
    half = round(values.shape[1] ** (1 / 3)) // 2
    return values.reshape(-1, half, 2, half, 2, half, 2).sum(axis=(2, 4, 6)).reshape(len(values), -1)


def _doubled(values: np.ndarray) -> np.ndarray:
    side = round(values.shape[1] ** (1 / 3))
    cubes = values.reshape(-1, side, 1, side, 1, side, 1)
    return np.broadcast_to(cubes, (len(values), side, 2, side, 2, side, 2)).reshape(len(values), -1).copy()
