"""Truncated signed distances in blocks near the surface, one view at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import trimesh

from room2dgs import _C
from room2dgs.config import MeshConfig
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.marching import extracted
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel import voxel_side
from room2dgs.mesh.voxel_table import BLOCK, VoxelTable, block_coordinates

if TYPE_CHECKING:
    from torch import Tensor

# pixels between those that say which blocks are near, and points at each, as the kernel has them
STRIDE, STEPS = 2, 4
APART = 0.8  # of a block's side: the largest distance between the points that blocks are found from


class Fusion(NamedTuple):
    """What fusion needs of `MeshConfig`, whose fields these are."""

    voxel_m: float
    truncation_voxels: float
    max_depth_m: float
    min_weight: float


def integrate(views: Iterable[FusedView], config: MeshConfig | Fusion) -> trimesh.Trimesh:
    """Fuse depth maps into a signed distance volume and extract its zero level by marching cubes.

    Each view counts near its own surface alone; `whole_surface` is what a run's mesh is made by.

    Memory follows the observed surface, not the number of views: each view is released before the next is asked
    for. open3d meshes the voxels; a kernel of ours takes the depth in, since open3d's has no weight for each pixel and
    measures along the view's axis only: a view at an angle would count for more than one that faces the surface.
    Rendered depth is fused with equal weights: weights by angle and distance made no difference, and grazing pixels are
    cut off beforehand (`valid_depth`).

    Args:
        views: depth in metres, 0 = invalid; all sizes and intrinsics may differ.
        config: the fields of `Fusion` are used; min_weight is a number of views.

    Returns:
        Mesh in the world frame with colours; its faces wind counter-clockwise seen from the cameras.
        Without vertices if no voxel was observed often enough. Vertex order depends on the number of threads
        (`clean` removes that).
    """
    table, origin = VoxelTable(), None
    for view in views:
        depth = usable_depth(view, config)
        if not (depth > 0).any():
            continue
        if origin is None:
            origin = start_of(view.camera, voxel_side(config))
        take_in(table, near_surface(view, depth, origin, config), origin, view, config)
    if origin is None:
        return trimesh.Trimesh(process=False)
    return extracted(table, voxel_side(config), origin, config.min_weight)


def usable_depth(view: FusedView, config: MeshConfig | Fusion) -> np.ndarray:
    """(H, W) float32: what may be fused, else 0."""
    return np.where(view.depth <= config.max_depth_m, view.depth, 0).astype(np.float32)


def normals_of(view: FusedView) -> np.ndarray:
    """(H, W, 3) float32, 0 where nobody knows them."""
    normal = np.zeros((*view.depth.shape, 3), np.float32) if view.normal is None else view.normal
    return np.ascontiguousarray(normal, np.float32)


def in_sight(keys: np.ndarray, pixel_from_voxel: np.ndarray, size: tuple[int, int], farthest_m: float) -> np.ndarray:
    """(N,) bool: blocks that a view may see, and perhaps some others.

    Args:
        pixel_from_voxel: (3, 4), as `camera_in_volume` has it.
        size: width and height in pixels.
        farthest_m: z-depth behind which nothing is seen.
    """
    middle = np.concatenate([BLOCK * (block_coordinates(keys) + 0.5), np.ones((len(keys), 1))], axis=1)
    row_u, row_v, row_z = pixel_from_voxel
    planes = [row_z, row_u, row_v, size[0] * row_z - row_u, size[1] * row_z - row_v]
    planes.append(np.append(-row_z[:3], farthest_m - row_z[3]))
    inside = np.ones(len(keys), bool)
    for plane in planes:
        inside &= middle @ plane >= -BLOCK * np.sqrt(3) / 2 * np.linalg.norm(plane[:3])
    return inside


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


def closer(farthest_m: float, K: np.ndarray, side_m: float) -> int:
    """How many times as many pixels a side `touched` needs: with small blocks, a photo's would jump over some."""
    apart = STRIDE * farthest_m / min(K[0, 0], K[1, 1])
    return max(1, math.ceil(apart / (APART * side_m)))


def touched(
    depth: np.ndarray,
    normal: np.ndarray,
    K: np.ndarray,
    cam_from_local: np.ndarray,
    voxel_m: float,
    truncation_m: float,
) -> np.ndarray:
    """(N,) int64 keys of the blocks that are across a surface within the truncation, rising, none twice.

    Args:
        depth: (H, W) float32 metres, 0 = invalid.
        normal: (H, W, 3) float32, world frame, towards the camera, 0 = unknown.
        cam_from_local: (4, 4) from the volume's frame.
    """
    times = closer(float(depth.max(initial=0.0)), K, BLOCK * voxel_m)
    if times > 1:
        depth, normal = (part.repeat(times, axis=0).repeat(times, axis=1) for part in (depth, normal))
        K = K * [[times], [times], [1]]
    height, width = depth.shape
    keys = np.empty((height // STRIDE * (width // STRIDE), STEPS), np.int64)
    _C.touched_blocks(depth, normal, K, local_from_cam(cam_from_local), BLOCK * voxel_m, truncation_m, keys)
    return np.unique(keys[keys >= 0])


def near_surface(view: FusedView, depth: np.ndarray, origin: np.ndarray, config: MeshConfig | Fusion) -> np.ndarray:
    """(N,) int64 keys of the blocks near a view's own surface (`touched`)."""
    side = voxel_side(config)
    cam_from_local, _ = camera_in_volume(view.camera, origin, side)
    return touched(depth, normals_of(view), view.camera.K, cam_from_local, side, side * config.truncation_voxels)


def take_in(
    table: VoxelTable, keys: np.ndarray, origin: np.ndarray, view: FusedView, config: MeshConfig | Fusion
) -> None:
    """A view's depth into some blocks of a table."""
    side = voxel_side(config)
    _, pixel_from_voxel = camera_in_volume(view.camera, origin, side)
    weight = np.ones(view.depth.shape, np.float32) if view.weight is None else view.weight
    photo = np.ascontiguousarray(photo_as_floats(view.color), np.float32)
    maps = (usable_depth(view, config), normals_of(view), np.ascontiguousarray(weight, np.float32), photo)
    blocks = block_coordinates(keys)
    for part, which, rows in table.in_parts(keys):
        _C.fuse_depth(blocks[which], rows, *part, *maps, pixel_from_voxel, side, side * config.truncation_voxels)


def photo_as_floats(color: np.ndarray | Tensor) -> np.ndarray | Tensor:
    """(H, W, 3) 0..255, as open3d keeps colours."""
    return color if "uint8" in str(color.dtype) else 255 * color
