"""Fusion by the CUDA kernels: `whole_surface` on a GPU (`render.device`).

Voxels, and the table of the blocks that hold them, stay on the device while views come; open3d meshes them on the CPU
at the end. Blocks are found, and a voxel takes a view in, by the CPU's own functions, so the same views give the same
mesh.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import torch
import trimesh
from torch import Tensor

from room2dgs.config import MeshConfig
from room2dgs.geometry.cells import coordinates
from room2dgs.kernels.builds import Build, build_of
from room2dgs.mesh.closing import closed
from room2dgs.mesh.tsdf import (
    STEPS,
    STRIDE,
    camera_in_volume,
    closer,
    in_sight,
    local_from_cam,
    photo_as_floats,
    start_of,
)
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel import voxel_side
from room2dgs.mesh.voxel_table import BLOCK, NUMBERS, VoxelTable
from room2dgs.mesh.whole_surface import Raw, gap_blocks, surface_of
from room2dgs.train.device import torch_device, upload


class DeviceTable:
    """Blocks of voxels on a device.

    Attributes:
        keys: (N,) int64, rising: the blocks' coordinates as one number each, as `touched_blocks` has them.
        parts: attributes as in `Voxels`, (N, numbers) float32; zeros where nothing was taken in.
    """

    def __init__(self, keys: Tensor) -> None:
        self.keys = keys
        self.parts = [torch.zeros(len(keys), count, device=keys.device) for count in NUMBERS]


def integrate_on_device(views: Iterable[FusedView], config: MeshConfig, device: str) -> Raw:
    """As `whole_surface`; the views' maps may lie on the device already.

    Args:
        device: `render.device`, not the CPU's own kernels.

    Raises:
        InputError: no GPU, or nothing that runs on it.
    """
    build, where, side = build_of(device), torch_device(device), voxel_side(config)
    found, origin = np.zeros(0, np.int64), None
    for view in views:
        depth = _usable_depth(view, config, where)
        if not bool((depth > 0).any()):
            continue
        if origin is None:
            origin = start_of(view.camera, side)
        cam_from_local, _ = camera_in_volume(view.camera, origin, side)
        at = (view.camera.K, cam_from_local, side, side * config.truncation_voxels)
        found = np.union1d(found, touched(depth, _normals_of(view, where), *at, build).cpu().numpy())
    if origin is None:
        return Raw(trimesh.Trimesh(process=False))
    voxels = DeviceTable(torch.from_numpy(closed(found, gap_blocks(side))).to(where))
    for view in views:
        _integrate_one(voxels, origin, view, config, build)
    return surface_of(_on_cpu(voxels), origin, config)


def touched(
    depth: Tensor,
    normal: Tensor,
    K: np.ndarray,
    cam_from_local: np.ndarray,
    voxel_m: float,
    truncation_m: float,
    build: Build,
) -> Tensor:
    """(M,) int64 keys of the blocks that `tsdf.touched` finds, rising, none twice."""
    times = closer(float(depth.max()) if depth.numel() else 0.0, K, BLOCK * voxel_m)
    if times > 1:
        depth, normal = (
            part.repeat_interleave(times, 0).repeat_interleave(times, 1).contiguous() for part in (depth, normal)
        )
        K = K * [[times], [times], [1]]
    height, width = depth.shape
    found = torch.empty((height // STRIDE) * (width // STRIDE), STEPS, dtype=torch.int64, device=depth.device)
    pose, side = local_from_cam(cam_from_local), BLOCK * voxel_m
    build.extension.touched_blocks(depth, normal, K, pose, side, truncation_m, found, build.queue(depth))
    return found[found >= 0].unique()


def _integrate_one(voxels: DeviceTable, origin: np.ndarray, view: FusedView, config: MeshConfig, build: Build) -> None:
    depth = _usable_depth(view, config, voxels.keys.device)
    side = voxel_side(config)
    _, pixel_from_voxel = camera_in_volume(view.camera, origin, side)
    reach = side * config.truncation_voxels
    farthest = float(depth.max()) + reach
    rows = torch.from_numpy(in_sight(voxels.keys.cpu().numpy(), pixel_from_voxel, view.camera.size, farthest))
    rows = rows.nonzero()[:, 0].to(depth.device)
    if not len(rows):
        return
    weight = torch.ones_like(depth) if view.weight is None else _there(view.weight, depth.device)
    photo = _there(photo_as_floats(view.color), depth.device)
    at = (pixel_from_voxel, side, reach)
    blocks = torch.stack(coordinates(voxels.keys[rows]), dim=1).to(torch.int32)
    maps = (depth, _normals_of(view, depth.device), weight, photo)
    build.extension.fuse_depth(blocks, rows, *voxels.parts, *maps, *at, build.queue(depth))


def _usable_depth(view: FusedView, config: MeshConfig, device: torch.device) -> Tensor:
    depth = _there(view.depth, device)
    return torch.where(depth <= config.max_depth_m, depth, 0.0)


def _normals_of(view: FusedView, device: torch.device) -> Tensor:
    return _there(np.zeros((*view.depth.shape, 3), np.float32) if view.normal is None else view.normal, device)


def _there(values: Tensor | np.ndarray, device: torch.device) -> Tensor:
    """Float32 on the device, contiguous."""
    if isinstance(values, Tensor):
        return values.to(device, torch.float32).contiguous()
    return upload(torch.from_numpy(np.ascontiguousarray(values, np.float32)), device)


def _on_cpu(voxels: DeviceTable) -> VoxelTable:
    table = VoxelTable()
    for part, which, at in table.in_parts(voxels.keys.cpu().numpy()):
        for theirs, ours in zip(voxels.parts, part, strict=True):
            ours[at] = theirs[torch.from_numpy(which).to(theirs.device)].cpu().numpy()
    return table
