"""Every (surfel, pixel) pair of a hard scene in float64, and where the picture jumps."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.splat import Surfels, reference
from room2dgs.splat.constants import ALPHA_MAX, DEN_MIN, EDGE_ON, FILTER_INVERSE_VARIANCE, TRANSMITTANCE_MIN
from room2dgs.tools.numerics.scenes import HardScene

NEAR = 1e-5  # relative distance from a jump at which rounding may take the other branch


class Pairs(NamedTuple):
    """Depth-sorted surfels (n) over pixels (m), row by row.

    Attributes:
        projected: the n surfels before the near plane, front to back.
        delta: (n, m, 2) pixels from the projected centres.
        den, u, v: (n, m) of the plane; 1 and finite where there is no hit.
        hit: (n, m) bool; the plane is hit before the camera.
        rho_plane, rho_filter, raw: (n, m); raw is the opacity before floor and clamp.
        counted: (n, m) bool; at or above the opacity floor, or nearly so.
        jump: (m,) bool; rounding may change which branch is taken.
    """

    projected: reference.Projected
    delta: Tensor
    den: Tensor
    u: Tensor
    v: Tensor
    hit: Tensor
    rho_plane: Tensor
    rho_filter: Tensor
    raw: Tensor
    counted: Tensor
    jump: Tensor


def pairs_of(scene: HardScene) -> Pairs:
    """All pairs of a scene, float64.

    The jumps are the opacity floor, the early stop, the half transmittance of the median, the clamp, the switch
    between disc and filter (its depth jumps), the near plane and edge-on discs.
    """
    surfels, floor = Surfels(*(x.double() for x in scene.surfels)), scene.opacity_floor
    p = reference.project(surfels, scene.K.double(), scene.cam_from_world, scene.near_m)
    order = reference.depth_order(p)
    p = reference.Projected(*(x[order] for x in p))
    y, x = torch.meshgrid(torch.arange(scene.height) + 0.5, torch.arange(scene.width) + 0.5, indexing="ij")
    delta = torch.stack([x, y], -1).reshape(1, -1, 2).double() - p.center_px[:, None]
    den = 1 + (delta * p.b[:, None]).sum(-1)
    limit = p.depth[:, None]
    hit = p.plane[:, None] & (den > DEN_MIN) & (scene.near_m * den <= limit)
    safe = torch.where(hit, den, 1.0)
    u, v = ((delta * a[:, None]).sum(-1) / safe for a in (p.a_u, p.a_v))
    plane, screen = u * u + v * v, FILTER_INVERSE_VARIANCE * (delta * delta).sum(-1)
    rho = torch.where(hit, torch.minimum(plane, screen), screen)
    raw = p.opacity[:, None] * torch.exp(-rho / 2)
    alpha = torch.where(raw >= floor, raw.clamp_max(ALPHA_MAX), 0.0)
    T = torch.cumprod(1 - alpha, 0)

    def close(a, b, band):
        return (a - b).abs() <= band * b

    counted = raw > 0.9 * floor
    jump = close(raw, floor, 20 * NEAR) | close(raw, ALPHA_MAX, NEAR)
    jump |= counted & (close(T, TRANSMITTANCE_MIN, 20 * NEAR) | close(T, 0.5, NEAR))
    jump |= counted & hit & close(plane, screen, 10 * NEAR)
    jump |= counted & close(scene.near_m * den, limit, NEAR)
    edge = (_cosine(surfels, scene.cam_from_world, order).abs() - EDGE_ON).abs() < 1e-6
    jump |= counted & edge[:, None]
    return Pairs(p, delta, safe, u, v, hit, plane, screen, raw, counted, jump.any(0))


def _cosine(surfels: Surfels, cam_from_world: Tensor, order: Tensor) -> Tensor:
    centers = surfels.centers[order] @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    normals = (cam_from_world[:3, :3] @ rotation_matrices(surfels.rotations[order]))[:, :, 2]
    return torch.einsum("ni,ni->n", normals, centers / centers.norm(dim=-1, keepdim=True))
