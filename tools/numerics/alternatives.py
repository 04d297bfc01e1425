"""The forms that we do not use, side by side with those that we do, in the float32 of a pixel.

Per-surfel numbers are computed in float64 and rounded for both sides: what differs is the form alone.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.splat import Surfels, reference
from room2dgs.splat.constants import ALPHA_MAX, DISTORTION_FAR_M, DISTORTION_NEAR_M
from room2dgs.tools.numerics.pairs import Pairs, pairs_of
from room2dgs.tools.numerics.scenes import HardScene


class Choices(NamedTuple):
    """Worst errors against float64, ours first.

    Attributes:
        opacity: absolute error of exp(-rho / 2) of counted hits on the disc: centre form, three planes.
        depth: relative error of their depth: centre form, three planes.
        distortion: error of the distortion over its largest value in the image (absolute where that is 0): shifted
            form, running sums.
    """

    opacity: tuple[float, float]
    depth: tuple[float, float]
    distortion: tuple[float, float]


def choices(scene: HardScene) -> Choices | None:
    """Both forms of both on one scene; None where no disc is hit."""
    pairs = pairs_of(scene)
    on_plane = pairs.counted & pairs.hit & (pairs.rho_plane <= pairs.rho_filter)
    if not on_plane.any():
        return None
    weight = torch.exp(-pairs.rho_plane / 2)
    depth = pairs.projected.depth[:, None] / pairs.den
    opacity, z = [], []
    for form in (centre_form(pairs), three_planes(scene)):
        u, v, found = (x.double()[on_plane] for x in form)
        opacity.append((torch.exp(-(u * u + v * v) / 2) - weight[on_plane]).abs().nan_to_num(nan=1.0).max().item())
        z.append(((found - depth[on_plane]) / depth[on_plane]).abs().nan_to_num(nan=1.0, posinf=1.0).max().item())
    w, z64 = blended(pairs, depth, scene.opacity_floor)
    exact = shifted(w, z64)
    largest = exact.max() if exact.any() else 1.0
    errors = [
        ((form(w.float(), z64.float()).double() - exact).abs().max() / largest).item() for form in (shifted, sums)
    ]
    return Choices((opacity[0], opacity[1]), (z[0], z[1]), (errors[0], errors[1]))


def centre_form(pairs: Pairs) -> tuple[Tensor, Tensor, Tensor]:
    """(n, m) u, v and depth in float32, as the kernels compute them."""
    p, delta = pairs.projected, pairs.delta.float()
    a_u, a_v, b, z = (x.float() for x in (p.a_u, p.a_v, p.b, p.depth))
    inverse = 1 / (1 + (delta * b[:, None]).sum(-1))
    return (delta * a_u[:, None]).sum(-1) * inverse, (delta * a_v[:, None]).sum(-1) * inverse, z[:, None] * inverse


def three_planes(scene: HardScene) -> tuple[Tensor, Tensor, Tensor]:
    """(n, m) u, v and depth in float32 by eq. 5-7: the pixel's two planes, carried into the disc's frame by K W H."""
    s = Surfels(*(x.double() for x in scene.surfels))
    order = reference.depth_order(reference.project(s, scene.K.double(), scene.cam_from_world, scene.near_m))
    axes = rotation_matrices(s.rotations[order])
    H = torch.zeros(len(order), 4, 3, dtype=torch.float64)
    H[:, :3, 0] = axes[:, :, 0] * s.scales[order, :1]
    H[:, :3, 1] = axes[:, :, 1] * s.scales[order, 1:]
    H[:, :3, 2], H[:, 3, 2] = s.centers[order], 1
    M = (scene.K.double() @ (scene.cam_from_world[:3] @ H)).float()  # rows: x z, y z, z over (u, v, 1)
    y, x = torch.meshgrid(torch.arange(scene.height) + 0.5, torch.arange(scene.width) + 0.5, indexing="ij")
    px, py = (c.reshape(1, -1, 1).float() for c in (x, y))
    hu, hv = px * M[:, None, 2] - M[:, None, 0], py * M[:, None, 2] - M[:, None, 1]
    bottom = hu[..., 0] * hv[..., 1] - hu[..., 1] * hv[..., 0]
    u = (hu[..., 1] * hv[..., 2] - hu[..., 2] * hv[..., 1]) / bottom
    v = (hu[..., 2] * hv[..., 0] - hu[..., 0] * hv[..., 2]) / bottom
    return u, v, M[:, 2, 0, None] * u + M[:, 2, 1, None] * v + M[:, 2, 2, None]


def blended(pairs: Pairs, depth: Tensor, floor: float) -> tuple[Tensor, Tensor]:
    """(n, m) weights and depths along each ray, front to back."""
    alpha = torch.where(pairs.raw >= floor, pairs.raw.clamp_max(ALPHA_MAX), 0.0)
    after = torch.cumprod(1 - alpha, 0)
    on_plane = pairs.hit & (pairs.rho_plane <= pairs.rho_filter)
    z = torch.where(on_plane, depth, pairs.projected.depth[:, None])
    return torch.cat([torch.ones_like(after[:1]), after[:-1]]) * alpha, z


SCALE = DISTORTION_FAR_M * DISTORTION_NEAR_M / (DISTORTION_FAR_M - DISTORTION_NEAR_M)


def shifted(w: Tensor, z: Tensor) -> Tensor:
    """(m,) distortion about the first hit, as the kernels have it."""
    first = torch.gather(z, 0, torch.argmax((w > 0).to(torch.int8), dim=0, keepdim=True))
    mu = torch.where(w > 0, SCALE * (z - first) / (z * first), 0.0)
    A, m1, m2 = (torch.cumsum(x, 0) - x for x in (w, w * mu, w * mu * mu))
    return (w * (mu * mu * A + m2 - 2 * mu * m1)).sum(0)


def sums(w: Tensor, z: Tensor) -> Tensor:
    """(m,) distortion by 2DGS's running sums of m = far / (far - near) (1 - near / z) itself."""
    m = torch.where(w > 0, DISTORTION_FAR_M / (DISTORTION_FAR_M - DISTORTION_NEAR_M) * (1 - DISTORTION_NEAR_M / z), 0.0)
    A, m1, m2 = (torch.cumsum(x, 0) - x for x in (w, w * m, w * m * m))
    return (w * (m * m * A + m2 - 2 * m * m1)).sum(0)
