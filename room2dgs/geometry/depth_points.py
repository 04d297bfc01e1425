"""Depth maps to points and normals."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs import _C


def depth_to_points(depth: Tensor, K: Tensor | np.ndarray, cam_from_world: Tensor | np.ndarray | None = None) -> Tensor:
    """Back-project every pixel's centre, (i + 0.5, j + 0.5).

    Args:
        depth: (H, W) z-depth, metres.
        K: (3, 3) intrinsics without skew, pixels.
        cam_from_world: (4, 4) pose; None gives points in the camera frame.

    Returns:
        (H, W, 3) metres, world frame if a pose is given; where the depth is 0, the camera's centre.
    """
    K = torch.as_tensor(K, dtype=depth.dtype, device=depth.device)
    height, width = depth.shape
    x = torch.arange(width, dtype=depth.dtype, device=depth.device) + 0.5
    y = torch.arange(height, dtype=depth.dtype, device=depth.device) + 0.5
    rays = torch.stack(
        [
            ((x - K[0, 2]) / K[0, 0]).expand(height, width),
            ((y - K[1, 2]) / K[1, 1])[:, None].expand(height, width),
            torch.ones_like(depth),
        ],
        dim=-1,
    )
    points = rays * depth[..., None]
    if cam_from_world is None:
        return points
    pose = torch.as_tensor(cam_from_world, dtype=depth.dtype, device=depth.device)
    return (points - pose[:3, 3]) @ pose[:3, :3]


def depth_to_normals(depth: Tensor, K: Tensor | np.ndarray, cam_from_world: Tensor | np.ndarray) -> Tensor:
    """Surface normals by central differences of the back-projected depth.

    A pixel has a normal if its depth and its four neighbours' are valid (positive and finite); pixels on the
    image's border have none. float32 on the CPU without a gradient takes the compiled kernel.

    Args:
        depth: (H, W) z-depth, metres; 0 = invalid.
        K: (3, 3) intrinsics without skew, pixels.
        cam_from_world: (4, 4) pose, rigid.

    Returns:
        (H, W, 3) unit normals, world frame, facing the camera; 0 where there is none.
    """
    pose_has_grad = isinstance(cam_from_world, Tensor) and cam_from_world.requires_grad
    wants_grad = torch.is_grad_enabled() and (depth.requires_grad or pose_has_grad)
    if wants_grad or not runs_compiled(depth):
        return normals_by_differences(depth, K, cam_from_world)[0]
    normal = torch.empty(*depth.shape, 3, dtype=torch.float32)
    _C.depth_normals(depth.detach().contiguous(), *intrinsics(K), rotation_of(cam_from_world), normal)
    return normal


def normals_by_differences(
    depth: Tensor, K: Tensor | np.ndarray, cam_from_world: Tensor | np.ndarray
) -> tuple[Tensor, Tensor]:
    """`depth_to_normals` in plain torch, any dtype, differentiable in the depth and in the pose.

    Returns:
        normal (H, W, 3) and valid (H, W) bool.
    """
    present = (depth > 0) & torch.isfinite(depth)
    valid = torch.zeros_like(present)
    valid[1:-1, 1:-1] = (
        present[1:-1, 1:-1] & present[1:-1, 2:] & present[1:-1, :-2] & present[2:, 1:-1] & present[:-2, 1:-1]
    )
    # A depth of 1 in place of the invalid ones keeps NaN out of the gradients.
    points = depth_to_points(torch.where(present, depth, torch.ones_like(depth)), K)
    normal = torch.zeros_like(points)
    along_x = points[1:-1, 2:] - points[1:-1, :-2]
    along_y = points[2:, 1:-1] - points[:-2, 1:-1]
    # x right, y down: their cross product points forward, so its negative faces the camera. For a pinhole
    # that holds at every pixel whose neighbours have positive depths, whatever these are.
    inner = -torch.nn.functional.normalize(torch.linalg.cross(along_x, along_y), dim=-1, eps=1e-30)
    normal = torch.nn.functional.pad(inner, (0, 0, 1, 1, 1, 1)) * valid[..., None]
    pose = torch.as_tensor(cam_from_world, dtype=depth.dtype, device=depth.device)
    return normal @ pose[:3, :3], valid


def runs_compiled(*maps: Tensor) -> bool:
    """True if the compiled kernels take these tensors."""
    return all(m.dtype == torch.float32 and m.device.type == "cpu" for m in maps)


def intrinsics(K: Tensor | np.ndarray) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a (3, 3) matrix without skew, pixels."""
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])


def rotation_of(cam_from_world: Tensor | np.ndarray) -> np.ndarray:
    """(3, 3) float64, contiguous, detached."""
    pose = cam_from_world.detach().cpu().numpy() if isinstance(cam_from_world, Tensor) else cam_from_world
    return np.ascontiguousarray(pose[:3, :3], dtype=np.float64)
