"""Signed distances in a space that holds everything: as it is near the cameras, pressed together far away.

Within the ball of radius r about the room nothing changes; a point outside, at distance d from its centre, goes to
r (2 - r/d), so that all the world lies within 2 r (the contraction of Mip-NeRF 360, in which 2DGS meshes unbounded
scenes).
Cells of one size there are voxels that grow as (d/r)^2 along the ray, and the truncation with them.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import trimesh

from room2dgs.config import MeshConfig
from room2dgs.geometry.arguments import check_points, number
from room2dgs.geometry.cells import cell_indices, keys_of
from room2dgs.mesh.marching import extracted
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel import voxel_side
from room2dgs.mesh.voxel_table import BLOCK, VOXELS, Voxels, VoxelTable, block_coordinates

INSIDE = 0.9  # of what the views see is nearer than the ball's radius
MOST = 1.9  # of 2, in radii: what is contracted further is left out (ten radii away)
STEP = 4  # pixels between those that the room's size is found from


def contracted(points: np.ndarray, radius: float) -> np.ndarray:
    """(N, 3) about the room's centre, metres, into the ball of twice the radius.

    Raises:
        TypeError, ValueError: no such points, or a radius that is not above 0.
    """
    points, radius = check_points("points", points), number("radius", radius, above=0.0)
    distance = np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-12)
    return np.where(
        distance <= radius, points, points * (2 - radius / np.maximum(distance, radius)) * radius / distance
    )


def expanded(points: np.ndarray, radius: float) -> np.ndarray:
    """The other way; points are to lie within twice the radius.

    Raises:
        TypeError, ValueError: as `contracted`.
    """
    points, radius = check_points("points", points), number("radius", radius, above=0.0)
    length = np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-12)
    away = radius / np.maximum(2 - length / radius, 1e-6)  # of those outside
    return np.where(length <= radius, points, points * away / length)


def integrate_contracted(views: Iterable[FusedView], config: MeshConfig) -> trimesh.Trimesh:
    """As `tsdf.integrate`, of everything that the views see.

    Args:
        views: gone through several times, so that going through them should cost little.
        config: voxel_m is the side of a voxel within the room.
    """
    side = voxel_side(config)
    seen, centres = [], []
    for view in views:
        seen.append(_points(view, config))
        centres.append(view.camera.centre)
    if not any(map(len, seen)):
        return trimesh.Trimesh(process=False)
    centre = np.mean(centres, axis=0)
    centre = np.round(centre / side) * side
    distances = np.concatenate([np.linalg.norm(points - centre, axis=1) for points in seen])
    radius = max(float(np.quantile(distances, INSIDE)), side * BLOCK)
    table = VoxelTable()
    for view in views:
        table.rows_of(_blocks(view, centre, radius, config))
    for part, which, rows in table.in_parts(table.keys):
        at = _voxels(table.keys[which]) * side
        size = np.linalg.norm(at, axis=1) / radius
        stretch = 1 / (2 - size.clip(1, MOST)) ** 2
        world = expanded(at, radius) + centre
        fused = _fused(views, world, config.truncation_voxels * side * stretch, config)
        kept = size < MOST
        for part_of, values in zip(part, fused, strict=True):
            values[~kept] = 0
            part_of[rows] = values.reshape(len(rows), -1)
    mesh = extracted(table, side, np.zeros(3), config.min_weight)
    if len(mesh.vertices):
        mesh.vertices = expanded(np.asarray(mesh.vertices), radius) + centre
    return mesh


def _fused(views: Iterable[FusedView], points: np.ndarray, truncation: np.ndarray, config: MeshConfig) -> Voxels:
    """Mean truncated distance (in truncations), weight, number of views and mean colour (0..255) of points."""
    total, weight, count = (np.zeros(len(points), np.float32) for _ in range(3))
    shade = np.zeros((len(points), 3), np.float32)
    for view in views:
        uv, z = view.camera.project(points)
        width, height = view.camera.size
        column, row = np.floor(uv[:, 0]), np.floor(uv[:, 1])
        inside = (z > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        who = np.flatnonzero(inside)
        column, row = column[who].astype(np.int64), row[who].astype(np.int64)
        depth = np.asarray(view.depth)[row, column]
        off = (depth - z[who]) / truncation[who]
        good = (depth > 0) & (depth <= config.max_depth_m) & (off > -1)
        who, row, column = who[good], row[good], column[good]
        pixel_weight = np.ones(len(who), np.float32)
        if view.weight is not None:
            pixel_weight = np.asarray(view.weight)[row, column].astype(np.float32)
        total[who] += pixel_weight * np.minimum(off[good], 1)
        weight[who] += pixel_weight
        count[who] += pixel_weight > 0
        color = np.asarray(view.color)
        picked = color[row, column] * np.float32(1 if color.dtype == np.uint8 else 255)
        shade[who] += pixel_weight[:, None] * picked
    many = np.maximum(weight, np.float32(1e-6))
    return Voxels(total / many, weight, count, shade / many[:, None])


def _points(view: FusedView, config: MeshConfig, step: int = STEP) -> np.ndarray:
    """(N, 3) float64, world: what the pixels see."""
    depth = np.where(view.depth <= config.max_depth_m, view.depth, 0)[::step, ::step]
    rays = view.camera.world_rays()[::step, ::step]
    return (view.camera.centre + rays * depth[..., None])[depth > 0]


def _blocks(view: FusedView, centre: np.ndarray, radius: float, config: MeshConfig) -> np.ndarray:
    """(N,) int64 keys of the blocks within the truncation of what the pixels see, rising."""
    points = contracted(_points(view, config, 2) - centre, radius)
    side = voxel_side(config) * BLOCK
    reach = config.truncation_voxels * voxel_side(config)
    found = []
    for corner in np.stack(np.meshgrid(*[(-1, 0, 1)] * 3), axis=-1).reshape(-1, 3):
        found.append(np.unique(keys_of(cell_indices(points + corner * reach, side))))
    return np.unique(np.concatenate(found))


def _voxels(keys: np.ndarray) -> np.ndarray:
    """(512 N, 3) whole-number coordinates of the voxels of blocks."""
    inner = np.arange(VOXELS)
    offset = np.stack([inner % BLOCK, inner // BLOCK % BLOCK, inner // BLOCK**2], axis=1)
    return (block_coordinates(keys)[:, None].astype(np.int64) * BLOCK + offset).reshape(-1, 3)
