"""Truncated signed distances in hashed blocks, one view at a time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import open3d as o3d
import open3d.core as o3c
import trimesh

from room2dgs.config import MeshConfig
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.views import FusedView

BLOCK = 8  # voxels a block side
# 10 kB a block. Growth copies the whole table (about 1 s in all for a room at 1 cm), so start with room for it.
FIRST_BLOCKS = 16_384
DEVICE = o3c.Device("CPU:0")


def integrate(views: Iterable[FusedView], config: MeshConfig) -> trimesh.Trimesh:
    """Fuse depth maps into a signed distance volume and extract its zero level by marching cubes.

    Memory follows the observed surface, not the number of views: each view is released before the next is asked
    for. Every view counts 1 in a voxel: open3d's integration has no weight per pixel, and a cosine weight through
    its voxel-coordinate API costs 20 to 35 times the built-in kernel, so grazing pixels are cut off beforehand
    (`valid_depth`).

    Args:
        views: depth in metres, 0 = invalid; all sizes and intrinsics may differ.
        config: voxel_m, truncation_voxels, max_depth_m, min_weight are used.

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
            volume = _empty_volume(config.voxel_m)
            origin = _origin(view.camera, config.voxel_m)
        _integrate_one(volume, origin, view, depth, config)
    if volume is None or volume.hashmap().size() == 0:
        return trimesh.Trimesh(process=False)
    return _extract(volume, origin, config.min_weight)


def _empty_volume(voxel_m: float) -> o3d.t.geometry.VoxelBlockGrid:
    return o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight", "color"),
        (o3c.float32, o3c.float32, o3c.float32),
        ((1,), (1,), (3,)),
        voxel_m,
        BLOCK,
        FIRST_BLOCKS,
        DEVICE,
    )


def _origin(camera: Camera, voxel_m: float) -> np.ndarray:
    """The volume works in float32, so its origin lies near the first camera, on the world's voxel lattice."""
    return np.round(camera.centre / voxel_m) * voxel_m


def _integrate_one(
    volume: o3d.t.geometry.VoxelBlockGrid,
    origin: np.ndarray,
    view: FusedView,
    depth: np.ndarray,
    config: MeshConfig,
) -> None:
    cam_from_local = view.camera.cam_from_world.copy()
    cam_from_local[:3, 3] += cam_from_local[:3, :3] @ origin
    # open3d looks up pixel floor(u), floor(v) of a projected voxel: centres at +0.5, as ours (a test proves it)
    intrinsics, pose = o3c.Tensor(view.camera.K), o3c.Tensor(cam_from_local)
    color = view.color.astype(np.float32) / 255 if view.color.dtype == np.uint8 else view.color
    color = np.ascontiguousarray(color, dtype=np.float32)
    depth_image = o3d.t.geometry.Image(o3c.Tensor(np.ascontiguousarray(depth)))
    color_image = o3d.t.geometry.Image(o3c.Tensor(color))
    # our depth is in metres already (scale 1) and already cut: the last bound only has to lie above it
    bounds = (1.0, float(depth.max()) + 1.0, float(config.truncation_voxels))
    try:
        blocks = volume.compute_unique_block_coordinates(depth_image, intrinsics, pose, *bounds)
    except RuntimeError as error:
        # open3d looks at a part of the pixels only, and takes it for a fault if none of them has a depth
        if "No block is touched" in str(error):
            return
        raise
    volume.integrate(blocks, depth_image, color_image, intrinsics, intrinsics, pose, *bounds)


def _extract(volume: o3d.t.geometry.VoxelBlockGrid, origin: np.ndarray, min_weight: float) -> trimesh.Trimesh:
    # open3d meshes voxels whose weight is strictly above its threshold; ours is the least weight that is meshed
    below = max(float(np.nextafter(np.float32(min_weight), np.float32(-1))), 0.0)
    mesh = volume.extract_triangle_mesh(below)
    if "positions" not in mesh.vertex or len(mesh.vertex.positions) == 0 or "indices" not in mesh.triangle:
        return trimesh.Trimesh(process=False)
    return trimesh.Trimesh(
        vertices=mesh.vertex.positions.numpy().astype(np.float64) + origin,
        faces=mesh.triangle.indices.numpy(),
        vertex_colors=np.round(np.clip(mesh.vertex.colors.numpy(), 0, 1) * 255).astype(np.uint8),
        process=False,
    )
