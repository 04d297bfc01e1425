"""2D Gaussian discs (2DGS, eq. 1)."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np
from torch import Tensor

from room2dgs import splat
from room2dgs.geometry.rotations import normals, tangents
from room2dgs.primitives.primitive import BASES, Primitive, Splats
from room2dgs.splat.types import Rendering, Surfels

FLAT = 1e-6  # metres: the third scale of what has none


class Surfel2D(Primitive):
    """Discs with two scales; the third column of the rotation's matrix is the normal."""

    splats = Surfels
    file_kind = "surfels"
    shapes = MappingProxyType({"centers": (3,), "rotations": (4,), "scales": (2,), "opacities": (), "sh": (BASES, 3)})

    def render(
        self, splats: Any, K: Tensor, cam_from_world: Tensor, width: int, height: int, **options: Any
    ) -> Rendering:
        return splat.render(splats, K, cam_from_world, width, height, **options)

    def scale_axes(self, splats: Splats) -> Tensor:
        return tangents(splats.rotations)

    def normals(self, splats: Splats) -> Tensor:
        return normals(splats.rotations)

    def footprints(self, splats: Splats) -> Tensor:
        return splats.scales.prod(dim=1).sqrt()

    def as_discs(self, splats: Splats) -> Surfels:
        return Surfels(*splats)

    def three_scales(self, splats: Splats) -> np.ndarray:
        scales = splats.scales.numpy()
        return np.column_stack([scales, np.full(len(scales), FLAT, scales.dtype)])
