"""The hard scenes with 3D Gaussians in the place of surfels, and where their pictures jump."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from room2dgs.primitives.gaussian3d import MipGaussians
from room2dgs.splat.constants import ALPHA_MAX, GAUSSIAN_DEN_MIN, GAUSSIAN_FILTER_PX2, MIP_FILTER_PX2, TRANSMITTANCE_MIN
from room2dgs.splat.gaussians import reference
from room2dgs.splat.types import Gaussians
from room2dgs.tools.numerics.pairs import NEAR
from room2dgs.tools.numerics.scenes import SCENES, HardScene


def thickened(scene: HardScene, seed: int = 31, kind: Callable[..., Gaussians | MipGaussians] = Gaussians) -> HardScene:
    """The scene's discs with a third scale, from a thousandth of the smaller one up to that."""
    s = scene.surfels
    share = 10 ** (-3 * torch.rand(len(s.scales), 1, generator=torch.Generator().manual_seed(seed)))
    if len(s.scales) and bool((s.scales == s.scales[:1]).all()):
        share = share[:1].expand(len(s.scales), 1)  # copies stay copies
    scales = torch.cat([s.scales, share * s.scales.amin(dim=1, keepdim=True)], dim=1)
    return scene._replace(surfels=kind(s.centers, s.rotations, scales, s.opacities, s.sh))


def jumps(scene: HardScene) -> Tensor:
    """(m,) bool: pixels where rounding may change which branch is taken.

    These are the opacity floor, the clamp, the early stop, the half transmittance, and where a ray's depth gives way
    to the centre's.
    """
    antialias = isinstance(scene.surfels, MipGaussians)
    gaussians = Gaussians(*(x.double() for x in scene.surfels))
    p = reference.project(
        gaussians, scene.K.double(), scene.cam_from_world, scene.width, scene.height, scene.near_m,
        filter_px2=MIP_FILTER_PX2 if antialias else GAUSSIAN_FILTER_PX2, compensated=antialias,
    )  # fmt: skip
    order = reference.depth_order(p)
    p = reference.Projected(*(x[order] for x in p))
    y, x = torch.meshgrid(torch.arange(scene.height) + 0.5, torch.arange(scene.width) + 0.5, indexing="ij")
    delta = torch.stack([x, y], -1).reshape(1, -1, 2).double() - p.center_px[:, None]
    rho = (delta * p.a_u[:, None]).sum(-1).square() + (delta * p.a_v[:, None]).sum(-1).square()
    den = 1 + (delta * p.b[:, None]).sum(-1)
    raw = p.opacity[:, None] * torch.exp(-rho / 2)
    T = torch.cumprod(1 - torch.where(raw >= scene.opacity_floor, raw.clamp_max(ALPHA_MAX), 0.0), 0)

    def close(a: Tensor, b: Tensor | float, band: float) -> Tensor:
        return (a - b).abs() <= band * (b.abs() if isinstance(b, Tensor) else b)

    counted = raw > 0.9 * scene.opacity_floor
    jump = close(raw, scene.opacity_floor, 20 * NEAR) | close(raw, ALPHA_MAX, NEAR)
    jump |= counted & (close(T, TRANSMITTANCE_MIN, 20 * NEAR) | close(T, 0.5, NEAR))
    jump |= counted & (close(scene.near_m * den, p.depth[:, None], NEAR) | close(den, GAUSSIAN_DEN_MIN, NEAR))
    return jump.any(0)


GAUSSIAN_SCENES: dict[str, Callable[[], HardScene]] = {
    f"{name}, {label}": partial(lambda make, kind: thickened(make(), kind=kind), make, kind)
    for label, kind in (("3D", Gaussians), ("3D mip", MipGaussians))
    for name, make in SCENES.items()
}
