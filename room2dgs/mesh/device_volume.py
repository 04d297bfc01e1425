"""Fusion by the CUDA kernels: `tsdf.integrate` on a GPU (`render.device`).

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
from room2dgs.mesh.marching import extracted
from room2dgs.mesh.tsdf import STEPS, STRIDE, camera_in_volume, closer, local_from_cam, photo_as_floats, start_of
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel import voxel_side
from room2dgs.mesh.voxel_table import BLOCK, NUMBERS, VoxelTable
from room2dgs.train.device import torch_device, upload

FIRST_BLOCKS = 4096  # 12 kB each


class DeviceTable:
    """Blocks of voxels on a device, in the order in which views touched them.

    Attributes:
        keys: (N,) int64, rising: the blocks' coordinates as one number each, as `touched_blocks` has them.
        rows: (N,) int64: where in `parts` each lies.
        parts: attributes as in `Voxels`, (capacity, numbers) float32; zeros where nothing was taken in.
    """

    def __init__(self, device: torch.device) -> None:
        self.keys, self.rows = (torch.zeros(0, dtype=torch.int64, device=device) for _ in range(2))
        self.parts = [torch.zeros(FIRST_BLOCKS, count, device=device) for count in NUMBERS]

    def rows_of(self, keys: Tensor) -> Tensor:
        """Rows of blocks, those that are new behind the others.

        Args:
            keys: (M,) int64, rising, none twice.
        """
        new = keys[~torch.isin(keys, self.keys)]
        first = len(self.rows)
        self.keys, order = torch.cat([self.keys, new]).sort()
        self.rows = torch.cat([self.rows, torch.arange(first, first + len(new), device=keys.device)])[order]
        self._make_room()
        return self.rows[torch.searchsorted(self.keys, keys)]

    def _make_room(self) -> None:
        if len(self.rows) <= len(self.parts[0]):
            return
        for index, part in enumerate(self.parts):  # one after the other: twice the largest is all that it takes more
            self.parts[index] = torch.cat([part, torch.zeros_like(part[:1]).expand(len(self.rows), -1)])


def integrate_on_device(views: Iterable[FusedView], config: MeshConfig, device: str) -> trimesh.Trimesh:
    """As `tsdf.integrate`; the views' maps may lie on the device already.

    Args:
        device: `render.device`, not the CPU's own kernels.

    Raises:
        InputError: no GPU, or nothing that runs on it.
    """
    build, where = build_of(device), torch_device(device)
    voxels, origin = None, np.zeros(3)
    for view in views:
        if voxels is None:
            voxels, origin = DeviceTable(where), start_of(view.camera, voxel_side(config))
        _integrate_one(voxels, origin, view, config, build)
    if voxels is None or not len(voxels.keys):
        return trimesh.Trimesh(process=False)
    return extracted(_on_cpu(voxels), voxel_side(config), origin, config.min_weight)


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
    depth = _there(view.depth, voxels.keys.device)
    depth = torch.where(depth <= config.max_depth_m, depth, 0.0)
    normal = torch.zeros(*depth.shape, 3) if view.normal is None else view.normal
    normal = _there(normal, depth.device)
    side = voxel_side(config)
    cam_from_local, pixel_from_voxel = camera_in_volume(view.camera, origin, side)
    reach = side * config.truncation_voxels
    keys = touched(depth, normal, view.camera.K, cam_from_local, side, reach, build)
    if not len(keys):
        return
    rows = voxels.rows_of(keys)
    weight = torch.ones_like(depth) if view.weight is None else _there(view.weight, depth.device)
    photo = _there(photo_as_floats(view.color), depth.device)
    at = (pixel_from_voxel, side, reach)
    blocks = torch.stack(coordinates(keys), dim=1).to(torch.int32)
    build.extension.fuse_depth(
        blocks, rows, *voxels.parts, depth, normal, weight, photo, *at, build.queue(depth)
    )  # fmt: skip


def _there(values: Tensor | np.ndarray, device: torch.device) -> Tensor:
    """Float32 on the device, contiguous."""
    if isinstance(values, Tensor):
        return values.to(device, torch.float32).contiguous()
    return upload(torch.from_numpy(np.ascontiguousarray(values, np.float32)), device)


def _on_cpu(voxels: DeviceTable) -> VoxelTable:
    table = VoxelTable()
    rows = voxels.rows.cpu().numpy()
    for part, which, at in table.in_parts(voxels.keys.cpu().numpy()):
        for theirs, ours in zip(voxels.parts, part, strict=True):
            ours[at] = theirs[rows[which]].cpu().numpy()
    return table
