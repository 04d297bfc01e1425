"""What a room is made of, optimised and rendered: the values of `primitive`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Primitive

PRIMITIVES: Registry[type[Primitive]] = Registry("primitive")
PRIMITIVES.register("surfel2d", "room2dgs.primitives.surfel2d:Surfel2D", "2D Gaussian discs, which 2DGS calls surfels.")
