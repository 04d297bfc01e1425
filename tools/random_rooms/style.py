"""What the pieces of one room share: a few woods, metals and cloths, and how messy the place is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.demo_room.geometry import Material
from room2dgs.tools.random_rooms import materials


@dataclass(frozen=True)
class Style:
    """A room's taste.

    Attributes:
        wood, front, metal, cloth, seat, plain: materials that come back in several pieces.
        mess: 0 (nothing lies about) to 1.
        turn: deviation in radians of how far pieces stand from the walls' directions.
    """

    wood: Material
    front: Material
    metal: Material
    cloth: Material
    seat: Material
    plain: Material
    mess: float
    turn: float


def random_style(rng: np.random.Generator) -> Style:
    """Draws a room's taste."""
    tidy = rng.random()
    return Style(
        wood=materials.wood(rng),
        front=materials.painted(rng) if rng.random() < 0.6 else materials.wood(rng),
        metal=materials.metal(rng),
        cloth=materials.cloth(rng),
        seat=materials.cloth(rng),
        plain=materials.painted(rng),
        mess=float(rng.beta(1.1, 1.3)),
        turn=0.02 if tidy < 0.5 else (0.12 if tidy < 0.8 else 0.5),
    )


def carcass(rng: np.random.Generator, style: Style) -> Material:
    """What a piece of furniture is made of: mostly the room's own wood or paint."""
    kind = rng.random()
    if kind < 0.35:
        return style.wood
    if kind < 0.55:
        return style.front
    if kind < 0.65:
        return style.plain
    return materials.wood(rng) if kind < 0.85 else materials.painted(rng)


def fabric(rng: np.random.Generator, style: Style) -> Material:
    """A cover: mostly the room's own."""
    kind = rng.random()
    if kind < 0.3:
        return style.cloth
    return style.seat if kind < 0.5 else materials.cloth(rng)
