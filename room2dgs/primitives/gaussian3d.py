"""3D Gaussians (3DGS), and the same with Mip-Splatting's filter of pixels."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs import splat
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.primitives.primitive import BASES, Primitive, Splats
from room2dgs.primitives.spawned import Spawned
from room2dgs.splat.types import Gaussians, Rendering, Surfels

FIRST_THICKNESS = 0.3  # of the smaller of a disc's scales, where a Gaussian starts as one
# quaternions (w, x, y, z) that bring axis k to the third place: (k + 1, k + 2, k)
_THIRD = ((0.5, 0.5, 0.5, 0.5), (0.5, -0.5, -0.5, -0.5), (1.0, 0.0, 0.0, 0.0))


class MipGaussians(NamedTuple):
    """`splat.Gaussians` that are drawn with Mip-Splatting's filter."""

    centers: Tensor
    rotations: Tensor
    scales: Tensor
    opacities: Tensor
    sh: Tensor


class Gaussian3D(Primitive):
    """Ellipsoids with three scales; what they say of the surface is that of their two larger axes."""

    splats: ClassVar[Callable[..., Any]] = Gaussians
    file_kind = "gaussians"
    called = "Gaussians"
    shapes = MappingProxyType({"centers": (3,), "rotations": (4,), "scales": (3,), "opacities": (), "sh": (BASES, 3)})
    antialias: ClassVar[bool] = False

    def render(
        self, splats: Any, K: Tensor, cam_from_world: Tensor, width: int, height: int, **options: Any
    ) -> Rendering:
        return splat.render_gaussians(
            Gaussians(*splats), K, cam_from_world, width, height, antialias=self.antialias, **options
        )

    def first_scales(self, spawned: Spawned) -> Tensor:
        return torch.cat([spawned.scales, FIRST_THICKNESS * spawned.scales.amin(dim=-1, keepdim=True)], dim=-1)

    def scale_axes(self, splats: Splats) -> Tensor:
        return rotation_matrices(splats.rotations).transpose(1, 2)

    def normals(self, splats: Splats) -> Tensor:
        thinnest = splats.scales.detach().argmin(dim=1)
        return self.scale_axes(splats)[torch.arange(len(thinnest), device=thinnest.device), thinnest]

    def footprints(self, splats: Splats) -> Tensor:
        low, high = splats.scales.amin(dim=1), splats.scales.amax(dim=1)
        return (high * (splats.scales.sum(dim=1) - low - high)).sqrt()

    def as_discs(self, splats: Splats) -> Surfels:
        thinnest = splats.scales.detach().argmin(dim=1)
        others = torch.stack([(thinnest + 1) % 3, (thinnest + 2) % 3], dim=1)
        turn = splats.rotations.new_tensor(_THIRD)[thinnest]
        return Surfels(
            splats.centers,
            _product(splats.rotations, turn),
            splats.scales.gather(1, others),
            splats.opacities,
            splats.sh,
        )

    def three_scales(self, splats: Splats) -> np.ndarray:
        return splats.scales.numpy()


class MipGaussian3D(Gaussian3D):
    """The same, whose opacity makes good what the pixel's filter adds (Mip-Splatting)."""

    splats = MipGaussians
    file_kind = "mip gaussians"
    antialias = True


def _product(a: Tensor, b: Tensor) -> Tensor:
    """Of quaternions, (N, 4) each."""
    w, v, x, u = a[:, :1], a[:, 1:], b[:, :1], b[:, 1:]
    real = w * x - (v * u).sum(dim=1, keepdim=True)
    return torch.cat([real, w * u + x * v + torch.linalg.cross(v, u)], dim=1)
