"""One surface from depth maps that disagree: all views vote in all blocks, and the field is made smooth."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import trimesh

from room2dgs.config import MeshConfig
from room2dgs.mesh.closing import closed
from room2dgs.mesh.marching import extracted
from room2dgs.mesh.regularise import regularise
from room2dgs.mesh.seen import SeenVoxels, seen_voxels
from room2dgs.mesh.tsdf import camera_in_volume, in_sight, near_surface, start_of, take_in, usable_depth
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel import voxel_side
from room2dgs.mesh.voxel_table import BLOCK, VoxelTable

GAP_M = 0.2  # gaps of a measured surface up to this width are closed


class Raw(NamedTuple):
    """A surface as it comes out of a volume.

    Attributes:
        mesh: world frame, with colours; without vertices if no voxel was observed often enough.
        seen: which of its vertices are measured; None: all.
    """

    mesh: trimesh.Trimesh
    seen: SeenVoxels | None = None


def whole_surface(views: Iterable[FusedView], config: MeshConfig) -> Raw:
    """Fuse depth maps into a signed distance volume, make it smooth and extract its zero level.

    Each view counts in each voxel that anybody's surface is near: one that looks through a place where another has
    surface says so. What few say, or nobody, follows from what is around it (`regularise`). Memory as `tsdf.integrate`.

    Args:
        views: gone through twice; depth in metres, 0 = invalid; all sizes and intrinsics may differ.
        config: `voxel_m` is a number (`voxel.with_voxel`).

    Returns:
        Its faces wind counter-clockwise seen from the cameras. Vertex order depends on the number of threads (`clean`
        removes that).
    """
    table, origin, side = VoxelTable(), None, voxel_side(config)
    for view in views:
        depth = usable_depth(view, config)
        if not (depth > 0).any():
            continue
        if origin is None:
            origin = start_of(view.camera, side)
        table.rows_of(near_surface(view, depth, origin, config))
    if origin is None:
        return Raw(trimesh.Trimesh(process=False))
    table.rows_of(closed(table.keys, gap_blocks(side)))
    for view in views:
        farthest = float(usable_depth(view, config).max(initial=0.0)) + side * config.truncation_voxels
        _, pixel_from_voxel = camera_in_volume(view.camera, origin, side)
        keys = table.keys[in_sight(table.keys, pixel_from_voxel, view.camera.size, farthest)]
        take_in(table, keys, origin, view, config)
    return surface_of(table, origin, config)


def surface_of(table: VoxelTable, origin: np.ndarray, config: MeshConfig) -> Raw:
    """The smooth surface of voxels that have taken all views in; the table is empty afterwards."""
    seen = seen_voxels(table, origin, voxel_side(config))
    regularise(table, config.min_weight)
    return Raw(extracted(table, voxel_side(config), origin, config.min_weight), seen)


def gap_blocks(voxel_m: float) -> int:
    """How far blocks grow together (`closed`) for gaps of `GAP_M`."""
    return math.ceil(GAP_M / 2 / (BLOCK * voxel_m))
