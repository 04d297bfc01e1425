"""A room while it is being filled."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Patch
from room2dgs.tools.random_rooms.placing import Plan, Wall
from room2dgs.tools.random_rooms.shell import Space
from room2dgs.tools.random_rooms.style import Style


class Draft:
    """A space, what is in it so far, and where there is still room.

    Attributes:
        space, style: the air and the taste.
        plan, walls: free floor and free walls.
        patches: what was added so far, the shell aside.
        behind: outlines (4, 2) of what lies behind the walls: other spaces, recesses.
        recess_limit: for walls with a space behind, how deep a recess may be (metres).
    """

    def __init__(self, space: Space, style: Style):
        self.space, self.style = space, style
        self.plan = Plan(space)
        self.walls = [Wall(space, index) for index in range(len(space.outline))]
        self.patches: list[Patch] = []
        self.behind: list[np.ndarray] = []
        self.recess_limit: dict[int, float] = {}
