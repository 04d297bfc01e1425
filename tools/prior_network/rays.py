"""Directions through the pixels, from the intrinsics."""

from __future__ import annotations

import torch
from torch import Tensor


def ray_slopes(intrinsics: Tensor, height: int, width: int, stride: int) -> Tensor:
    """Slopes of the rays through the centres of cells of stride x stride pixels.

    Args:
        intrinsics: (B, 3, 3) in pixels, centres at +0.5.
        height, width: cells.
        stride: pixels of a cell's side.

    Returns:
        (B, 2, height, width): (x - cx) / fx and (y - cy) / fy.
    """
    x = (torch.arange(width, device=intrinsics.device, dtype=intrinsics.dtype) + 0.5) * stride
    y = (torch.arange(height, device=intrinsics.device, dtype=intrinsics.dtype) + 0.5) * stride
    fx, fy, cx, cy = (intrinsics[:, row, column, None] for row, column in ((0, 0), (1, 1), (0, 2), (1, 2)))
    across = ((x - cx) / fx)[:, None, :].expand(-1, height, -1)
    down = ((y - cy) / fy)[:, :, None].expand(-1, -1, width)
    return torch.stack([across, down], dim=1)


def unit_rays(slopes: Tensor) -> Tensor:
    """(B, 2, H, W) slopes -> (B, 3, H, W) unit directions, camera frame."""
    rays = torch.cat([slopes, torch.ones_like(slopes[:, :1])], dim=1)
    return rays / rays.norm(dim=1, keepdim=True)


def plane_distance(depth: Tensor, normal: Tensor, slopes: Tensor) -> Tensor:
    """The camera's distance from the plane that touches the surface, metres.

    Args:
        depth: (B, 1, H, W) z-depth in metres, 0 = invalid.
        normal: (B, 3, H, W) unit, camera frame, facing the camera; 0 = invalid.
        slopes: (B, 2, H, W) of the pixels' rays.

    Returns:
        (B, 1, H, W), 0 = invalid.
    """
    rays = torch.cat([slopes, torch.ones_like(slopes[:, :1])], dim=1)
    return (-(normal * rays).sum(dim=1, keepdim=True) * depth).clamp(min=0.0)
