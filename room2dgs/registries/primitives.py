"""What a room is made of, optimised and rendered: the values of `primitive`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Primitive

PRIMITIVES: Registry[type[Primitive]] = Registry("primitive")
_AT = "room2dgs.primitives"
PRIMITIVES.register("surfel2d", f"{_AT}.surfel2d:Surfel2D", "2D Gaussian discs, which 2DGS calls surfels.")
PRIMITIVES.register("gaussian3d", f"{_AT}.gaussian3d:Gaussian3D", "3D Gaussians, as in 3DGS.")
PRIMITIVES.register(
    "mip_gaussian3d", f"{_AT}.gaussian3d:MipGaussian3D", "3D Gaussians with Mip-Splatting's filter of pixels."
)
