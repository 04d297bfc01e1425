"""The rasterizer in plain torch, for any dtype: slow, readable, and the oracle of the compiled kernels."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.camera import NEAR_M
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.geometry.spherical_harmonics import sh_color
from room2dgs.splat.checks import check_floating, check_shapes, check_values
from room2dgs.splat.constants import (
    ALPHA_MAX,
    DEN_MIN,
    DISTORTION_FAR_M,
    DISTORTION_NEAR_M,
    EDGE_ON,
    FILTER_INVERSE_VARIANCE,
    OPACITY_FLOOR,
    QUATERNION_MIN,
    TRANSMITTANCE_MIN,
)
from room2dgs.splat.types import Rendering, Surfels

TILE = 16


class Projected(NamedTuple):
    """The nine numbers of a surfel in one view, and what is blended.

    With delta = x - center_px: den = 1 + b.delta, z = depth / den, u = a_u.delta / den, v = a_v.delta / den.

    Attributes:
        center_px: (N, 2) projected centre.
        depth: (N,) z-depth of the centre, metres.
        a_u, a_v: (N, 2) per pixel.
        b: (N, 2) per pixel.
        plane: (N,) bool; False for an edge-on disc, which has the screen-space filter alone.
        opacity: (N,).
        color: (N, 3).
        normal: (N, 3) unit, world frame, facing the camera.
        visible: (N,) bool; the centre is beyond the near plane, and the quaternion and the scales make a disc.
    """

    center_px: Tensor
    depth: Tensor
    a_u: Tensor
    a_v: Tensor
    b: Tensor
    plane: Tensor
    opacity: Tensor
    color: Tensor
    normal: Tensor
    visible: Tensor


def project(
    surfels: Surfels, K: Tensor, cam_from_world: Tensor, near_m: float, center_px: Tensor | None = None
) -> Projected:
    """Surfels to their nine numbers in one view (centre form of eq. 5-7)."""
    R, t = cam_from_world[:3, :3], cam_from_world[:3, 3]
    world_axes = rotation_matrices(surfels.rotations)
    p = surfels.centers @ R.T + t
    axes = R @ world_axes
    disc = (surfels.rotations.detach().double().norm(dim=-1) > QUATERNION_MIN) & (surfels.scales.detach() > 0).all(-1)
    visible = disc & (p[:, 2] >= near_m)
    # a culled centre may lie in the camera plane; it is never drawn, so any finite stand-in will do
    depth = torch.where(visible, p[:, 2], torch.ones_like(p[:, 2]))
    d = p / depth[:, None]
    focal = torch.stack([K[0, 0], K[1, 1]])
    center = d[:, :2] * focal + K[:2, 2]
    if center_px is not None:
        center = center + center_px
    cosine = torch.einsum("ni,ni->n", axes[:, :, 2], d)
    plane = cosine.abs() > EDGE_ON * d.norm(dim=-1)
    kappa = torch.where(plane, cosine, torch.ones_like(cosine))
    b = axes[:, :2, 2] / focal / kappa[:, None]

    def slope(axis: int) -> Tensor:
        tangent = axes[:, :, axis]
        along = torch.einsum("ni,ni->n", tangent, d)
        return depth[:, None] * (tangent[:, :2] / focal - along[:, None] * b) / surfels.scales[:, axis, None]

    side = torch.where(cosine < 0, 1.0, -1.0).to(d.dtype)
    camera_center = -R.T @ t
    view = torch.nn.functional.normalize(surfels.centers - camera_center, dim=-1)
    return Projected(
        center, depth, slope(0), slope(1), b, plane, surfels.opacities, sh_color(surfels.sh, view),
        side[:, None] * world_axes[:, :, 2], visible,
    )  # fmt: skip


def render(
    surfels: Surfels,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    *,
    background: Tensor | None = None,
    near_m: float = NEAR_M,
    opacity_floor: float = OPACITY_FLOOR,
    center_px: Tensor | None = None,
    stored: Callable[[Projected], Projected] = lambda projected: projected,
) -> Rendering:
    """Render one view; same meaning as `room2dgs.splat.render`, any floating dtype and device.

    Args:
        stored: what becomes of the surfels' numbers on their way from projection to pixels.

    Raises:
        TypeError, ValueError: as `room2dgs.splat.render`.
    """
    check_shapes(surfels, K, cam_from_world, width, height, background, center_px)
    check_floating(**surfels._asdict())
    dtype, device = surfels.centers.dtype, surfels.centers.device
    K = K.to(dtype=dtype, device=device)
    cam_from_world = cam_from_world.to(dtype)
    center_px = None if center_px is None else center_px.to(dtype)
    background = torch.zeros(3, dtype=dtype, device=device) if background is None else background.to(dtype)
    check_values(K.detach(), cam_from_world.detach(), background.detach(), near_m, opacity_floor)
    projected = stored(project(surfels, K, cam_from_world, near_m, center_px))
    order = depth_order(projected)
    reach = _angular_reach(surfels, cam_from_world.detach(), K.detach(), opacity_floor)[order]
    projected = Projected(*(x[order] for x in projected))
    bearing = torch.nn.functional.normalize(
        torch.cat(
            [(projected.center_px.detach() - K[:2, 2]) / K[[0, 1], [0, 1]], torch.ones_like(reach)[:, None]],
            1,
        ),
        dim=-1,
    )

    def tile(pixels: Tensor) -> tuple[Tensor, ...]:
        near_tile = _meets_tile(pixels, K, bearing, reach)
        return _composite(Projected(*(v[near_tile] for v in projected)), pixels, background, near_m, opacity_floor)

    return in_tiles(tile, width, height, K)


def in_tiles(tile: Callable[[Tensor], tuple[Tensor, ...]], width: int, height: int, like: Tensor) -> Rendering:
    """A rendering from its tiles; `tile` gives the images at some pixels, (m, 2) to (m, ...) each, of `like`'s type."""
    rows = []
    for y in range(0, height, TILE):
        row = []
        for x in range(0, width, TILE):
            h, w = min(TILE, height - y), min(TILE, width - x)
            ys, xs = torch.meshgrid(torch.arange(h) + y + 0.5, torch.arange(w) + x + 0.5, indexing="ij")
            pixels = torch.stack([xs, ys], dim=-1).reshape(-1, 2).to(like)
            row.append([v.reshape(h, w, *v.shape[1:]) for v in tile(pixels)])
        rows.append([torch.cat(parts, dim=1) for parts in zip(*row, strict=True)])
    return Rendering(*(torch.cat(parts, dim=0) for parts in zip(*rows, strict=True)))


def depth_order(projected: Any) -> Tensor:
    """Indices of what is `visible`, front to back: by `depth` in float32, equal ones by index.

    Finer differences than float32 has are rounding; so all dtypes, and the kernels, blend in one order.
    """
    order = torch.argsort(projected.depth.detach().float(), stable=True)
    return order[projected.visible[order]]


def _angular_reach(surfels: Surfels, cam_from_world: Tensor, K: Tensor, opacity_floor: float) -> Tensor:
    """(N,) radians: no visible part of a disc, nor its filter, is further than this from its centre's bearing."""
    rho_max = 2 * torch.log((surfels.opacities.detach() / opacity_floor).clamp_min(1.0))
    radius = surfels.scales.detach().amax(dim=-1) * rho_max.sqrt()
    distance = (surfels.centers.detach() @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]).norm(dim=-1)
    disc = torch.where(radius < distance, torch.asin((radius / distance).clamp(max=1.0)), math.pi)
    return disc + 4.0 / torch.minimum(K[0, 0], K[1, 1])


def _meets_tile(pixels: Tensor, K: Tensor, bearing: Tensor, reach: Tensor) -> Tensor:
    """(N,) bool: conservative test of bearings against the tile's cone."""
    rays = torch.cat([(pixels - K[:2, 2]) / K[[0, 1], [0, 1]], torch.ones_like(pixels[:, :1])], dim=1)
    rays = torch.nn.functional.normalize(rays, dim=-1)
    axis = torch.nn.functional.normalize(rays.mean(dim=0), dim=0)
    half_angle = torch.acos((rays @ axis).clamp(-1.0, 1.0)).max()
    return torch.acos((bearing @ axis).clamp(-1.0, 1.0)) <= half_angle + reach + 1e-6


def _composite(
    s: Projected, pixels: Tensor, background: Tensor, near_m: float, opacity_floor: float
) -> tuple[Tensor, ...]:
    """Blend depth-sorted surfels (n) over pixels (m); returns colour, alpha, depth, median, normal, distortion."""
    delta = pixels[None] - s.center_px[:, None]  # (n, m, 2)
    den = 1 + torch.einsum("nmi,ni->nm", delta, s.b)
    hit = s.plane[:, None] & (den > DEN_MIN) & (near_m * den <= s.depth[:, None])
    safe = torch.where(hit, den, torch.ones_like(den))
    u = torch.einsum("nmi,ni->nm", delta, s.a_u) / safe
    v = torch.einsum("nmi,ni->nm", delta, s.a_v) / safe
    rho_plane = u * u + v * v
    rho_filter = FILTER_INVERSE_VARIANCE * (delta * delta).sum(dim=-1)
    on_plane = hit & (rho_plane <= rho_filter)
    rho = torch.where(on_plane, rho_plane, rho_filter)
    z = torch.where(on_plane, s.depth[:, None] / safe, s.depth[:, None].expand_as(safe))
    return blended(s.opacity, s.color, s.normal, rho, z, background, opacity_floor)


def blended(
    opacity: Tensor, color: Tensor, normal: Tensor, rho: Tensor, z: Tensor, background: Tensor, opacity_floor: float
) -> tuple[Tensor, ...]:
    """Blend n depth-sorted splats over m pixels; returns colour, alpha, depth, median, normal, distortion.

    Args:
        opacity: (n,); color, normal: (n, 3).
        rho, z: (n, m) squared distance in standard deviations, and z-depth of each hit.
    """
    raw = opacity[:, None] * torch.exp(-0.5 * rho)
    alpha = torch.where(raw >= opacity_floor, raw.clamp_max(ALPHA_MAX), torch.zeros_like(raw))
    after = torch.cumprod(1 - alpha, dim=0)
    before = torch.cat([torch.ones_like(after[:1]), after[:-1]], dim=0)
    hit = (alpha > 0) & (before >= TRANSMITTANCE_MIN)
    w = torch.where(hit, before * alpha, torch.zeros_like(alpha))
    total = w.sum(dim=0)
    # the transmittance that is left includes nothing behind the stop
    image = torch.einsum("nm,nc->mc", w, color) + (1 - total)[:, None] * background
    expected = torch.where(total > 0, (w * z).sum(dim=0) / torch.where(total > 0, total, 1.0), 0.0)
    crossing = hit & (before > 0.5) & (after <= 0.5)
    median = torch.where(crossing, z, torch.zeros_like(z)).sum(dim=0)
    return image, total, expected, median, torch.einsum("nm,nc->mc", w, normal), _distortion(w, z, hit)


def _distortion(w: Tensor, z: Tensor, blended: Tensor) -> Tensor:
    """(m,) sum_{i>j} w_i w_j (m_i - m_j)^2, about the first hit so that nothing cancels."""
    if len(w) == 0:
        return w.sum(dim=0)
    first = torch.argmax(blended.to(torch.int8), dim=0, keepdim=True)
    z0 = torch.gather(z, 0, first).detach()
    k = DISTORTION_FAR_M * DISTORTION_NEAR_M / (DISTORTION_FAR_M - DISTORTION_NEAR_M)
    mu = torch.where(blended, k * (z - z0) / (z * z0), torch.zeros_like(z))
    sums = [torch.cumsum(x, dim=0) - x for x in (w, w * mu, w * mu * mu)]
    return (w * (mu * mu * sums[0] + sums[2] - 2 * mu * sums[1])).sum(dim=0)
