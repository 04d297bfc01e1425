"""Blank walls: paint in one colour, as most rooms have it and stereo fears it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from room2dgs.demo_room.geometry import Patch
from room2dgs.tools.random_rooms import materials

WALL, CEILING = "wall", "ceiling"


def with_blank_walls(patches: list[Patch], share: float, rng: np.random.Generator) -> list[Patch]:
    """The patches, of whose walls about `share` are now one colour without any texture; so is the ceiling then.

    Pieces of a wall beside its openings stay alike; one colour serves all walls, an accent aside.
    """
    main, accent, white = materials.blank_paint(rng), materials.blank_paint(rng), materials.blank_paint(rng, pale=True)
    covers = {}
    for tag in dict.fromkeys(patch.tag for patch in patches):
        if tag.removeprefix(WALL).isdigit() and rng.random() < share:
            covers[tag] = accent if rng.random() < 0.15 else main
        elif tag == CEILING and rng.random() < share:
            covers[tag] = white
    return [replace(patch, material=covers[patch.tag]) if patch.tag in covers else patch for patch in patches]
