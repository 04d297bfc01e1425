"""What is optimised and rendered."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

PRIMITIVES: Registry[Any] = Registry("primitive")
PRIMITIVES.register("surfel2d", "room2dgs.primitives.surfel2d:Surfel2D", "2D Gaussian discs, which 2DGS calls surfels.")
