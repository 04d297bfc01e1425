"""Depth maps to points and normals.

In torch, with gradients. `depth_normals` is the same for numpy maps and a `Camera`; `Camera.unproject_map` gives their
points.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.kernel_arguments import intrinsics, rotation_of, runs_compiled


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
    _C.depth_normals(depth.detach().contiguous().numpy(), *intrinsics(K), rotation_of(cam_from_world), normal.numpy())
    return normal


def depth_normals(depth: np.ndarray, camera: Camera, step: int = 1, max_jump: float = 0.1) -> np.ndarray:
    """Normals of a depth map by central differences over 2 x `step` pixels, in the camera frame.

    A wider step averages out the rounding of a depth map in millimetres.

    Args:
        depth: (H, W) z-depth, metres; 0 = invalid.
        camera: of the depth map's size.
        step: pixels to either side.
        max_jump: neighbours whose depth differs by a larger fraction lie on another surface.

    Returns:
        (H, W, 3) float64, unit, camera frame, facing the camera; 0 where a neighbour is invalid, on
        another surface or outside the image.
    """
    with torch.no_grad():
        values = torch.from_numpy(np.asarray(depth, dtype=np.float64))
        return normals_by_differences(values, camera.K, None, step, max_jump)[0].numpy()


def normals_by_differences(
    depth: Tensor,
    K: Tensor | np.ndarray,
    cam_from_world: Tensor | np.ndarray | None,
    step: int = 1,
    max_jump: float | None = None,
) -> tuple[Tensor, Tensor]:
    """`depth_to_normals` in plain torch, any dtype, differentiable in the depth and in the pose.

    Args:
        depth, K: as `depth_to_normals` has them.
        cam_from_world: (4, 4) pose; None gives normals in the camera frame.
        step: the neighbours are so many pixels away.
        max_jump: a neighbour whose depth differs by a larger fraction counts as invalid; None: any will do.

    Returns:
        normal (H, W, 3) and valid (H, W) bool.
    """
    present = (depth > 0) & torch.isfinite(depth)
    # A depth of 1 in place of the invalid ones keeps NaN out of the gradients.
    depth = torch.where(present, depth, torch.ones_like(depth))
    points = depth_to_points(depth, K)
    if min(depth.shape) <= 2 * step:
        normal, valid = 0 * points, torch.zeros_like(present)
    else:
        normal, valid = _inner_normals(depth, points, present, step, max_jump)
        normal = normal * valid[..., None]
        normal = torch.nn.functional.pad(normal, (0, 0, step, step, step, step))
        valid = torch.nn.functional.pad(valid, (step, step, step, step))
    if cam_from_world is None:
        return normal, valid
    pose = torch.as_tensor(cam_from_world, dtype=depth.dtype, device=depth.device)
    return normal @ pose[:3, :3], valid


def _inner_normals(
    depth: Tensor, points: Tensor, present: Tensor, step: int, max_jump: float | None
) -> tuple[Tensor, Tensor]:
    """Normals in the camera frame, and which are valid, of the pixels that have all four neighbours."""
    along = {-1: slice(0, -2 * step), 0: slice(step, -step), 1: slice(2 * step, None)}

    def at(values: Tensor, row: int, column: int) -> Tensor:
        return values[along[row], along[column]]

    valid = at(present, 0, 0).clone()
    for row, column in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        valid &= at(present, row, column)
        if max_jump is not None:
            valid &= (at(depth, row, column) - at(depth, 0, 0)).abs() <= max_jump * at(depth, 0, 0)
    along_x = at(points, 0, 1) - at(points, 0, -1)
    along_y = at(points, 1, 0) - at(points, -1, 0)
    # x right, y down: their cross product points forward, so its negative faces the camera. For a pinhole
    # that holds at every pixel whose neighbours have positive depths, whatever these are.
    return -torch.nn.functional.normalize(torch.linalg.cross(along_x, along_y), dim=-1, eps=1e-30), valid
