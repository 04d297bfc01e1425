"""The filtered depth of all views as one coloured point cloud with normals."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from room2dgs.captures.world_offset import AT_ORIGIN, Origin, too_far_for_float32, xyz_in_world
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.cells import cell_indices


class Cloud(NamedTuple):
    """Points on surfaces.

    Attributes:
        xyz: (N, 3) float64 metres, world frame.
        normal: (N, 3) float32 unit, world frame, towards the cameras that saw the point.
        rgb: (N, 3) uint8.
    """

    xyz: np.ndarray
    normal: np.ndarray
    rgb: np.ndarray


def fused_cloud(views: Iterable[tuple[Camera, np.ndarray, np.ndarray, np.ndarray]], cell_m: float) -> Cloud:
    """One point in each occupied cell: the mean of the pixels that fall into it.

    Memory follows the surface, not the number of views: each view is thinned out before the next is asked for. The
    same views give the same bits.

    Args:
        views: camera, depth (H, W) metres with 0 = none, normal (H, W, 3) world frame, colour (H, W, 3) uint8.
        cell_m: side of a cell.
    """
    kept: tuple[np.ndarray, np.ndarray] | None = None  # cells (N, 3) and sums (N, 10): xyz, normal, rgb, count
    for camera, depth, normal, color in views:
        there = depth > 0
        xyz = camera.unproject_map(depth)[there]
        rows = np.concatenate([xyz, normal[there], color[there], np.ones((len(xyz), 1))], axis=1)
        cells = cell_indices(xyz, cell_m)
        if kept is not None:
            cells, rows = np.concatenate([kept[0], cells]), np.concatenate([kept[1], rows])
        if len(cells):
            kept = _summed(cells, rows)
    if kept is None:
        return Cloud(np.zeros((0, 3)), np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    mean = kept[1] / kept[1][:, 9:]
    length = np.linalg.norm(mean[:, 3:6], axis=1, keepdims=True)
    normal = mean[:, 3:6] / np.maximum(length, 1e-9)
    return Cloud(mean[:, :3], normal.astype(np.float32), np.rint(mean[:, 6:9]).astype(np.uint8))


def _summed(cells: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.lexsort(cells.T)
    cells, rows = cells[order], rows[order]
    first = np.flatnonzero(np.concatenate([[True], (cells[1:] != cells[:-1]).any(axis=1)]))
    return cells[first], np.add.reduceat(rows, first, axis=0)


def ply_bytes(cloud: Cloud, origin_m: Origin = AT_ORIGIN) -> bytes:
    """Binary PLY with normals and colours.

    Args:
        origin_m: `Scene.origin_m`; the file lies in the capture's own world, far from its origin in double.
    """
    xyz = xyz_in_world(cloud.xyz, origin_m)
    place = "<f8" if too_far_for_float32(xyz) else "<f4"
    fields = [*((name, place) for name in ("x", "y", "z")), *((name, "<f4") for name in ("nx", "ny", "nz"))]
    fields += [(name, "u1") for name in ("red", "green", "blue")]
    table = np.empty(len(cloud.xyz), fields)
    for names, values in (("x y z", xyz), ("nx ny nz", cloud.normal), ("red green blue", cloud.rgb)):
        for column, name in enumerate(names.split()):
            table[name] = values[:, column]
    kinds = {"<f8": "double", "<f4": "float", "u1": "uchar"}
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    lines += [f"property {kinds[kind]} {name}" for name, kind in fields]
    return ("\n".join([*lines, "end_header"]) + "\n").encode() + table.tobytes()
