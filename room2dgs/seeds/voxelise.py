"""Points to occupied voxels (eq. 8)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.errors import InputError
from room2dgs.geometry.arguments import check_points, number
from room2dgs.geometry.cells import HALF_RANGE, coordinates, keys_of


class Voxels(NamedTuple):
    """Occupied cells in rising order of their keys (x slowest, z fastest).

    Attributes:
        centres: (S, 3) float64, metres.
        means: (S, 3) float64, mean of each cell's points, metres.
        rgb: (S, 3) float64, mean colour of each cell's points, 0..255.
    """

    centres: np.ndarray
    means: np.ndarray
    rgb: np.ndarray


def cell_keys(xyz: np.ndarray, voxel_m: float) -> np.ndarray:
    """One integer for each point's cell, ordered as (x, y, z).

    Args:
        xyz: (M, 3) metres.
        voxel_m: edge of a cell.

    Returns:
        (M,) int64; see `cell_centres` for the way back.

    Raises:
        InputError: a coordinate is not finite, or more than 2^20 cells away from the origin.
        TypeError, ValueError: no such points, or no edge above 0.
    """
    xyz = check_points("xyz", xyz)
    number("voxel_m", voxel_m, above=0.0)
    cells = np.floor(np.asarray(xyz, dtype=np.float64) / voxel_m)
    # `not (all inside)` also refuses NaN
    if not np.all((cells >= -HALF_RANGE) & (cells < HALF_RANGE)):
        raise InputError(
            f"the points reach beyond {HALF_RANGE * voxel_m:.0f} m or are not finite, "
            f"too far for seeds.voxel_m={voxel_m:g}; remove the outliers or raise seeds.voxel_m"
        )
    return keys_of(cells)


def cell_centres(keys: np.ndarray, voxel_m: float) -> np.ndarray:
    """(S,) keys of `cell_keys` to (S, 3) float64 centres, floor(P/d) d + d/2, metres.

    The printed eq. 8 has the floor alone, which is a corner; the text says centre.
    """
    cells = np.stack(coordinates(keys), axis=1)
    return cells * voxel_m + 0.5 * voxel_m


def point_keys(xyz: np.ndarray, voxel_m: float) -> np.ndarray:
    """`cell_keys` of points that seeds are made of.

    Raises:
        InputError: no points, or points out of range (see `cell_keys`).
    """
    if len(xyz) == 0:
        raise InputError("there are no points to seed from; give more overlapping views or a point file")
    return cell_keys(xyz, voxel_m)


def voxelise(xyz: np.ndarray, rgb: np.ndarray, voxel_m: float) -> Voxels:
    """Occupied voxels of a point cloud (eq. 8); the same bits for any order of the points.

    Args:
        xyz: (M, 3) metres.
        rgb: (M, 3) uint8.
        voxel_m: edge of a voxel, the paper's delta.

    Raises:
        InputError: no points, or points out of range (see `cell_keys`).
        TypeError, ValueError: no such points or colours, or not as many of both.
    """
    xyz = np.asarray(check_points("xyz", xyz), dtype=np.float64)
    if len(check_points("rgb", rgb)) != len(xyz):
        raise ValueError(f"there are {len(rgb)} colours for {len(xyz)} points")
    keys = point_keys(xyz, voxel_m)
    # sums of floats depend on their order, so the order inside a cell is fixed too
    order = np.lexsort((xyz[:, 2], xyz[:, 1], xyz[:, 0], keys))
    unique, first = np.unique(keys[order], return_index=True)
    counts = np.diff(np.append(first, len(keys)))[:, None]
    means = np.add.reduceat(xyz[order], first, axis=0) / counts
    colors = np.add.reduceat(np.asarray(rgb, dtype=np.float64)[order], first, axis=0) / counts
    return Voxels(cell_centres(unique, voxel_m), means, colors)
