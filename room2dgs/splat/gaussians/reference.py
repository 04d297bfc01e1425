"""3D Gaussians in plain torch, for any dtype: slow, readable, and the oracle of the compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.camera import NEAR_M
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.geometry.spherical_harmonics import sh_color
from room2dgs.splat.checks import check_floating, check_shapes, check_values
from room2dgs.splat.constants import (
    BEYOND_VIEW,
    GAUSSIAN_DEN_MIN,
    GAUSSIAN_FILTER_PX2,
    MIP_FILTER_PX2,
    OPACITY_FLOOR,
    QUATERNION_MIN,
)
from room2dgs.splat.reference import blended, depth_order, in_tiles
from room2dgs.splat.types import Gaussians, Rendering


class Projected(NamedTuple):
    """Gaussians in one view.

    Attributes:
        center_px: (N, 2) projected centre.
        depth: (N,) z-depth of the centre, metres.
        a_u, a_v: (N, 2) with rho = (a_u.delta)^2 + (a_v.delta)^2, delta from the centre, per pixel; a_v.x is 0.
        b: (N, 2) of z = depth / (1 + b.delta), per pixel.
        opacity: (N,) after compensation.
        color: (N, 3).
        normal: (N, 3) unit, world frame, facing the camera: of the plane that `b` describes.
        visible: (N,) bool.
    """

    center_px: Tensor
    depth: Tensor
    a_u: Tensor
    a_v: Tensor
    b: Tensor
    opacity: Tensor
    color: Tensor
    normal: Tensor
    visible: Tensor


def project(
    gaussians: Gaussians,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    near_m: float,
    center_px: Tensor | None = None,
    filter_px2: float = GAUSSIAN_FILTER_PX2,
    compensated: bool = False,
) -> Projected:
    """Gaussians to ellipses in one view.

    About the centre the map of camera points to (x, y, 1/z) is taken as linear; the third coordinate's mean along a
    pixel's ray is its regression on the first two. In 1/z planes stay planes, so that it is exact for flat Gaussians.
    """
    R, t = cam_from_world[:3, :3], cam_from_world[:3, 3]
    p = gaussians.centers @ R.T + t
    sound = gaussians.rotations.detach().double().norm(dim=-1) > QUATERNION_MIN
    visible = sound & (gaussians.scales.detach() > 0).all(-1) & (p[:, 2] >= near_m)
    depth = torch.where(visible, p[:, 2], torch.ones_like(p[:, 2]))
    d = p[:, :2] / depth[:, None]
    focal, principal = torch.stack([K[0, 0], K[1, 1]]), K[:2, 2]
    center = d * focal + principal
    if center_px is not None:
        center = center + center_px
    size = K.new_tensor([width, height])
    margin = BEYOND_VIEW * 0.5 * size / focal
    held = torch.minimum(torch.maximum(d, -principal / focal - margin), (size - principal) / focal + margin)
    axes = R @ rotation_matrices(gaussians.rotations) * gaussians.scales[:, None, :] / depth[:, None, None]
    across = focal[:, None] * (axes[:, :2] - held[:, :, None] * axes[:, 2:])  # (N, 2, 3)
    inverse_depth = -axes[:, 2]  # (N, 3), relative
    bare = across @ across.transpose(1, 2)
    covariance = bare + filter_px2 * torch.eye(2).to(bare)
    precision = torch.linalg.inv(covariance)
    b = (precision @ across @ inverse_depth[:, :, None]).squeeze(2)
    lower = torch.linalg.cholesky_ex(precision).L
    opacity = gaussians.opacities
    if compensated:
        kept = torch.linalg.cross(across[:, 0], across[:, 1]).square().sum(-1) / torch.linalg.det(covariance)
        visible = visible & (kept.detach() > 0)
        opacity = opacity * torch.where(visible, kept, torch.ones_like(kept)).sqrt()
    tilt = b * focal
    plane = torch.cat([tilt, 1 - (tilt * d).sum(-1, keepdim=True)], dim=1)
    normal = -torch.nn.functional.normalize(plane, dim=-1) @ R
    view = torch.nn.functional.normalize(gaussians.centers + R.T @ t, dim=-1)
    color = sh_color(gaussians.sh, view)
    return Projected(center, depth, lower[:, :, 0], lower[:, :, 1], b, opacity, color, normal, visible)


def render(
    gaussians: Gaussians,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    *,
    background: Tensor | None = None,
    near_m: float = NEAR_M,
    opacity_floor: float = OPACITY_FLOOR,
    center_px: Tensor | None = None,
    antialias: bool = False,
    stored: Callable[[Projected], Projected] = lambda projected: projected,
) -> Rendering:
    """Render one view; same meaning as `room2dgs.splat.render_gaussians`, any floating dtype and device.

    Args:
        stored: what becomes of the numbers on their way from projection to pixels.

    Raises:
        TypeError, ValueError: as `room2dgs.splat.render_gaussians`.
    """
    check_shapes(gaussians, K, cam_from_world, width, height, background, center_px)
    check_floating(**gaussians._asdict())
    like = gaussians.centers
    K, cam_from_world = K.to(like), cam_from_world.to(like)
    background = torch.zeros(3).to(like) if background is None else background.to(like)
    check_values(K.detach(), cam_from_world.detach(), background.detach(), near_m, opacity_floor)
    filter_px2 = MIP_FILTER_PX2 if antialias else GAUSSIAN_FILTER_PX2
    center_px = None if center_px is None else center_px.to(like)
    s = stored(project(gaussians, K, cam_from_world, width, height, near_m, center_px, filter_px2, antialias))
    order = depth_order(s)
    s = Projected(*(x[order] for x in s))

    def tile(pixels: Tensor) -> tuple[Tensor, ...]:
        delta = pixels[None] - s.center_px[:, None]  # (n, m, 2)
        rho = torch.einsum("nmi,ni->nm", delta, s.a_u).square() + torch.einsum("nmi,ni->nm", delta, s.a_v).square()
        den = 1 + torch.einsum("nmi,ni->nm", delta, s.b)
        of_ray = near_m * den <= s.depth[:, None]
        held = torch.where(of_ray, den, torch.ones_like(den)).clamp_min(GAUSSIAN_DEN_MIN)
        z = s.depth[:, None] / held
        return blended(s.opacity, s.color, s.normal, rho, z, background, opacity_floor)

    return in_tiles(tile, width, height, K)
