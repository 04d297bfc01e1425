"""Truncated signed distances in hashed blocks, one view at a time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import open3d as o3d
import open3d.core as o3c
import trimesh

from room2dgs import _C
from room2dgs.config import MeshConfig
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.views import FusedView

if TYPE_CHECKING:
    from torch import Tensor

ATTRIBUTES = ("tsdf", "weight", "views", "color")
BLOCK = 8  # voxels a block side
HALF = 2**20  # of a key's base: blocks on either side of the origin
STRIDE, STEPS = 2, 4  # pixels between those that say which blocks are near, and points at each, as the kernel has them
# 10 kB a block. Growth copies the whole table (about 1 s in all for a room at 1 cm), so start with room for it; open3d
# would double it, which is hundreds of megabytes that stay empty.
FIRST_BLOCKS, GROWTH = 16_384, 1.25
DEVICE = o3c.Device("CPU:0")


def integrate(views: Iterable[FusedView], config: MeshConfig) -> trimesh.Trimesh:
    """Fuse depth maps into a signed distance volume and extract its zero level by marching cubes.

    Memory follows the observed surface, not the number of views: each view is released before the next is asked
    for. open3d keeps the voxels and meshes them; a kernel of ours takes the depth in, since open3d's has no weight for
    each pixel and measures along the view's axis only: a view at an angle would count for more than one that faces the
    surface. Rendered depth is fused with equal weights: weights by angle and distance made no difference, and grazing
    pixels are cut off beforehand (`valid_depth`).

    Args:
        views: depth in metres, 0 = invalid; all sizes and intrinsics may differ.
        config: voxel_m, truncation_voxels, max_depth_m, min_weight (a number of views) are used.

    Returns:
        Mesh in the world frame with colours; its faces wind counter-clockwise seen from the cameras.
        Without vertices if no voxel was observed often enough. Vertex order depends on the number of threads
        (`clean` removes that).
    """
    volume, origin = None, np.zeros(3)
    for view in views:
        depth = np.where(view.depth <= config.max_depth_m, view.depth, 0).astype(np.float32)
        if not (depth > 0).any():
            continue
        if volume is None:
            volume = empty_volume(config.voxel_m)
            origin = start_of(view.camera, config.voxel_m)
        _integrate_one(volume, origin, view, depth, config)
    if volume is None or volume.hashmap().size() == 0:
        return trimesh.Trimesh(process=False)
    return extracted(volume, origin, config.min_weight)


def empty_volume(voxel_m: float, room_for: int = FIRST_BLOCKS) -> o3d.t.geometry.VoxelBlockGrid:
    """Without blocks; on the CPU, so that its attributes can be written in place."""
    return o3d.t.geometry.VoxelBlockGrid(
        ATTRIBUTES,
        (o3c.float32,) * len(ATTRIBUTES),
        ((1,), (1,), (1,), (3,)),
        voxel_m,
        BLOCK,
        room_for,
        DEVICE,
    )


def start_of(camera: Camera, voxel_m: float) -> np.ndarray:
    """(3,) the volume's origin: it works in float32, so near the first camera, on the world's voxel lattice."""
    return np.round(camera.centre / voxel_m) * voxel_m


def camera_in_volume(camera: Camera, origin: np.ndarray, voxel_m: float) -> tuple[np.ndarray, np.ndarray]:
    """(4, 4) cam_from_local, metres; (3, 4) from voxels about the origin to (u z, v z, z), pixels and metres."""
    cam_from_local = camera.cam_from_world.copy()
    cam_from_local[:3, 3] += cam_from_local[:3, :3] @ origin
    pixel_from_voxel = camera.K @ cam_from_local[:3]
    pixel_from_voxel[:, :3] *= voxel_m
    return cam_from_local, pixel_from_voxel


def local_from_cam(cam_from_local: np.ndarray) -> np.ndarray:
    """(3, 4) metres, the inverse of a rigid (4, 4)."""
    rotation, translation = cam_from_local[:3, :3], cam_from_local[:3, 3:]
    return np.ascontiguousarray(np.concatenate([rotation.T, -rotation.T @ translation], axis=1))


def touched(
    depth: np.ndarray,
    normal: np.ndarray,
    K: np.ndarray,
    cam_from_local: np.ndarray,
    voxel_m: float,
    truncation_m: float,
) -> np.ndarray:
    """(N, 3) int32 coordinates of the blocks that are across a surface within the truncation, none twice.

    Args:
        depth: (H, W) float32 metres, 0 = invalid.
        normal: (H, W, 3) float32, world frame, towards the camera, 0 = unknown.
        cam_from_local: (4, 4) from the volume's frame.
    """
    height, width = depth.shape
    keys = np.empty((height // STRIDE * (width // STRIDE), STEPS), np.int64)
    _C.touched_blocks(depth, normal, K, local_from_cam(cam_from_local), BLOCK * voxel_m, truncation_m, keys)
    found = np.unique(keys[keys >= 0])
    base = 2 * HALF
    parts = (found // base**2, found // base % base, found % base)
    return (np.stack(parts, axis=1) - HALF).astype(np.int32)


def _integrate_one(
    volume: o3d.t.geometry.VoxelBlockGrid,
    origin: np.ndarray,
    view: FusedView,
    depth: np.ndarray,
    config: MeshConfig,
) -> None:
    reach = config.voxel_m * config.truncation_voxels
    cam_from_local, pixel_from_voxel = camera_in_volume(view.camera, origin, config.voxel_m)
    normal = np.zeros((*depth.shape, 3), np.float32) if view.normal is None else view.normal
    normal = np.ascontiguousarray(normal, np.float32)
    blocks = touched(depth, normal, view.camera.K, cam_from_local, config.voxel_m, reach)
    if not len(blocks):
        return
    rows = rows_of(volume.hashmap(), o3c.Tensor(blocks))
    parts = [volume.attribute(name).numpy() for name in ATTRIBUTES]  # not copies; growth of the table moves them
    _C.fuse_depth(
        blocks,
        rows,
        *(part.reshape(len(part), -1) for part in parts),
        depth,
        normal,
        np.ones_like(depth) if view.weight is None else np.ascontiguousarray(view.weight, np.float32),
        np.ascontiguousarray(photo_as_floats(view.color), np.float32),
        pixel_from_voxel,
        config.voxel_m,
        reach,
    )


def rows_of(hashmap: o3c.HashMap, blocks: o3c.Tensor) -> np.ndarray:
    """(N,) int64 rows of the table in which these (N, 3) int32 blocks are; those that are not there are added."""
    rows, known = hashmap.find(blocks)
    new = blocks[known.logical_not()]
    if len(new):
        needed = hashmap.size() + len(new)
        if needed > hashmap.capacity():
            hashmap.reserve(max(needed, int(GROWTH * hashmap.capacity())))
        hashmap.activate(new)
        rows, _ = hashmap.find(blocks)
    return rows.numpy().astype(np.int64)


def photo_as_floats(color: np.ndarray | Tensor) -> np.ndarray | Tensor:
    """(H, W, 3) 0..255, as open3d keeps colours."""
    return color if "uint8" in str(color.dtype) else 255 * color


def extracted(volume: o3d.t.geometry.VoxelBlockGrid, origin: np.ndarray, min_weight: float) -> trimesh.Trimesh:
    """The zero level, moved by `origin`, with colours; without vertices if there is none."""
    weight = volume.attribute("weight").numpy()
    weight[volume.attribute("views").numpy() < min_weight] = 0
    mesh = volume.extract_triangle_mesh(0.0)
    if "positions" not in mesh.vertex or len(mesh.vertex.positions) == 0 or "indices" not in mesh.triangle:
        return trimesh.Trimesh(process=False)
    return trimesh.Trimesh(
        vertices=mesh.vertex.positions.numpy().astype(np.float64) + origin,
        faces=mesh.triangle.indices.numpy(),
        vertex_colors=np.round(np.clip(mesh.vertex.colors.numpy(), 0, 1) * 255).astype(np.uint8),
        process=False,
    )
