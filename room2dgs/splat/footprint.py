"""Where surfels lie on the screen: what other tools ask for beside the images."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.splat.checks import check_far, check_floating, check_near, check_shapes
from room2dgs.splat.constants import FILTER_INVERSE_VARIANCE, OPACITY_FLOOR
from room2dgs.splat.types import Surfels

SIGMAS = 3.0


class Footprint(NamedTuple):
    """Surfels on one view's screen, without gradients.

    Attributes:
        center_px: (N, 2) projected centres; where `seen`.
        depth: (N,) z-depth of the centres, metres.
        radius_px: (N, 2) int32, half width and half height about the centre of the box that holds three standard
            deviations, rounded up; 0 where a surfel is not seen.
        seen: (N,) bool: opaque enough, between the planes, and the box meets the image.
    """

    center_px: Tensor
    depth: Tensor
    radius_px: Tensor
    seen: Tensor


@torch.no_grad()
def footprint(
    surfels: Surfels, K: Tensor, cam_from_world: Tensor, width: int, height: int, near_m: float, far_m: float
) -> Footprint:
    """Boxes of the discs' outlines at three standard deviations; a disc that reaches the camera's plane has the image.

    Args:
        K: (3, 3); cam_from_world: (4, 4); both of the surfels' type.
        near_m, far_m: z-depths between which centres count.

    Raises:
        TypeError, ValueError: shapes, types or planes that do not fit.
    """
    check_shapes(surfels, K, cam_from_world, width, height, None, None)
    check_floating(**surfels._asdict(), K=K, cam_from_world=cam_from_world)
    check_near(near_m)
    check_far("far_m", far_m, near_m)
    R, t = cam_from_world[:3, :3], cam_from_world[:3, 3]
    p = surfels.centers @ R.T + t
    depth = p[:, 2]
    between = (depth >= near_m) & (depth <= far_m)
    z = torch.where(between, depth, torch.ones_like(depth))
    d = p[:, :2] / z[:, None]
    focal = torch.stack([K[0, 0], K[1, 1]])
    center = d * focal + K[:2, 2]
    edges = (R @ rotation_matrices(surfels.rotations))[:, :, :2] * surfels.scales[:, None, :]  # (N, 3, 2)
    across = focal[:, None] * (edges[:, :2] - d[:, :, None] * edges[:, 2:])  # (N, 2, 2): screen axis, disc axis
    along = edges[:, 2]
    room = z * z - SIGMAS**2 * along.square().sum(-1)
    whole = room > 0
    factor = (SIGMAS**2 / torch.where(whole, room, torch.ones_like(room)))[:, None]
    shift = -factor * (across * along[:, None, :]).sum(-1)
    half = (shift.square() + factor * across.square().sum(-1)).sqrt() + shift.abs()
    half = half.clamp_min(SIGMAS / FILTER_INVERSE_VARIANCE**0.5)
    size = torch.tensor([width, height], dtype=half.dtype, device=half.device)
    to_the_far_edge = (center - size / 2).abs() + size / 2
    half = torch.where(whole[:, None], half, to_the_far_edge).ceil()
    inside = ((center + half > 0) & (center - half < size)).all(-1) | ~whole
    seen = between & inside & (surfels.opacities >= OPACITY_FLOOR)
    radius = torch.where(seen[:, None], half.clamp(max=1e6), torch.zeros_like(half)).to(torch.int32)
    return Footprint(center, depth, radius, seen)
