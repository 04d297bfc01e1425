"""Which pieces stand where: a whole random room.

World frame: metres, z up, the floor at z = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from room2dgs.tools.random_rooms import fittings, materials, seats, shell, storage, tables
from room2dgs.tools.random_rooms.clutter import LARGE, SMALL
from room2dgs.tools.random_rooms.placing import Plan, Wall
from room2dgs.tools.random_rooms.shell import Opening, Space
from room2dgs.tools.random_rooms.style import Style, random_style
from room2dgs.tools.random_rooms.shapes import moved
from room2dgs.tools.room_geometry import Patch

Rng = np.random.Generator
WALL_PIECES = (seats.sofa, seats.bed, seats.armchair, tables.desk, tables.tv_board, storage.shelf, storage.cupboard,
               storage.cupboard, storage.fridge, fittings.radiator)
FREE_PIECES = (tables.table, tables.table, seats.chair, seats.stool, seats.office_chair)


@dataclass(frozen=True)
class RandomRoom:
    """A room's geometry.

    Attributes:
        patches: all surfaces; at least one has an emitter's material.
        inside: points (N, 3) -> (N,) bool, in the free air of the shell, furniture ignored.
        height: metres, of the ceiling at its highest.
        blocked: points (N, 3) -> (N,) bool, within the bounding box of a large piece.
        bounds: lowest and highest corner (2, 3) of the main space.
    """

    patches: list[Patch]
    inside: Callable[[np.ndarray], np.ndarray]
    height: float
    blocked: Callable[[np.ndarray], np.ndarray]
    bounds: np.ndarray


@dataclass
class Draft:
    """A room while it is being filled."""

    space: Space
    plan: Plan
    walls: list[Wall]
    style: Style
    patches: list[Patch] = field(default_factory=list)


def random_room(rng: Rng) -> RandomRoom:
    """Draws a room: shell, lights, furniture, clutter.

    The same state of `rng` gives the same room.
    """
    outline = shell.random_outline(rng)
    profile = shell.random_profile(rng, float(outline[:, 1].max()))
    space, style = Space(outline, profile), random_style(rng)
    draft = Draft(space, Plan(space), [Wall(space, k) for k in range(len(outline))], style)
    windows(rng, draft)
    lamps(rng, draft)
    fill(rng, draft)
    covers = shell.wall_materials(rng, len(outline))
    patches = shell.space_patches(space, materials.floor(rng), materials.ceiling(rng), covers)
    if rng.random() < 0.7:
        tall, thick, board = rng.uniform(0.04, 0.14), rng.uniform(0.008, 0.02), style.wood if rng.random() < 0.5 else style.plain
        for index in range(len(outline)):
            patches += shell.skirting(space, index, tall, thick, board)
    height = float(space.top(outline[:, 1]).max())
    bounds = np.array([[*outline.min(axis=0), 0.0], [*outline.max(axis=0), height]])
    return RandomRoom(patches + draft.patches, space.encloses, height, draft.plan.blocked, bounds)


def windows(rng: Rng, draft: Draft) -> None:
    """Zero to three windows, each in a recess or set on the wall."""
    light = materials.daylight(rng)
    for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.25, 0.4, 0.25, 0.1]))):
        wall = draft.walls[rng.integers(len(draft.walls))]
        width, low = rng.uniform(0.5, 2.0), rng.choice([0.0, 0.4, 0.9, 1.1], p=[0.12, 0.13, 0.5, 0.25])
        height = rng.uniform(0.6, 1.5) if low else rng.uniform(1.9, 2.2)
        spot = wall.free_spot(rng, width + 0.3, low, low + height + 0.1)
        if spot is None:
            continue
        wall.take(spot, width + 0.2, low - 0.05, low + height + 0.1)
        if rng.random() < 0.6:
            hole, depth = Opening(spot - width / 2, spot + width / 2, low, low + height), rng.uniform(0.05, 0.35)
            draft.space.openings.setdefault(wall.index, []).append(hole)
            frame = materials.painted(rng)
            patches = shell.reveal(hole, depth, frame, materials.stone(rng))
            patches.append(shell.back_face(hole, depth, light, "light"))
            patches += moved(fittings.window_bars(rng, width, height, -depth + 0.002, frame), (spot, 0, low))
        else:
            patches = moved(fittings.flat_window(rng, draft.style, width, height, light), (spot, 0, low))
        top = wall.height(spot, width)
        dressing = rng.random()
        if dressing < 0.35 and low + height + 0.15 < top:
            patches += moved(fittings.curtains(rng, draft.style, width, low + height + 0.12), (spot, 0, 0))
        elif dressing < 0.5:
            patches += moved(fittings.blind(rng, draft.style, width, height), (spot, 0, low))
        draft.patches += draft.space.on_wall(patches, wall.index, 0.0)


def lamps(rng: Rng, draft: Draft) -> None:
    """Lamps; one at least where no window shines."""
    lit = any(patch.material.kind == "emitter" for patch in draft.patches)
    count = int(rng.choice([0, 1, 2, 3], p=[0.3, 0.45, 0.18, 0.07])) if lit else int(rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1]))
    low, high = draft.space.outline.min(axis=0), draft.space.outline.max(axis=0)
    light = materials.lamp(rng)
    while count > 0:
        spot = rng.uniform(low + 0.4, high - 0.4)
        if not draft.space.contains(spot[None])[0]:
            continue
        top = float(draft.space.top(spot[1]))
        if top < 1.9:
            continue
        lamp = fittings.ceiling_lamp(rng, draft.style, light)
        draft.patches += moved(lamp, (*spot, top), rng.choice([0.0, np.pi / 2, rng.uniform(0, 3)]))
        count -= 1


def fill(rng: Rng, draft: Draft) -> None:
    """Furniture along the walls and in the middle, pictures, rugs, clutter on the floor."""
    area, style = draft.plan.area, draft.style
    amount = rng.beta(1.2, 1.2)
    if rng.random() < 0.3:
        closed = fittings.closed_door(rng, style)
        hang(rng, draft, closed, 0.0, blocks=True)
    for _ in range(int(rng.poisson(0.5))):
        draft.plan.place(rng, draft, fittings.rug(rng, style), flat=True)
    for _ in range(int(amount * (2 + 0.6 * area))):
        draft.plan.place_at_wall(rng, draft, WALL_PIECES[rng.integers(len(WALL_PIECES))](rng, style))
    for _ in range(int(rng.poisson(amount * (0.5 + 0.15 * area)))):
        draft.plan.place(rng, draft, FREE_PIECES[rng.integers(len(FREE_PIECES))](rng, style))
    for _ in range(int(rng.poisson(3 * amount))):
        hang(rng, draft, fittings.picture(rng, style), rng.uniform(0.9, 1.6))
    for _ in range(int(rng.poisson(1.0))):
        hang(rng, draft, fittings.sockets(rng, style), rng.choice([0.2, 1.05]))
    for _ in range(int(rng.poisson(style.mess * 0.5 * area))):
        things = LARGE if rng.random() < 0.7 else SMALL
        draft.plan.place(rng, draft, things[rng.integers(len(things))](rng))


def hang(rng: Rng, draft: Draft, patches: list[Patch], height: float, blocks: bool = False) -> None:
    """Fixes a piece to a free stretch of a random wall, its z = 0 at `height`; nothing if there is no room."""
    points = np.concatenate([patch.grid.reshape(-1, 3) for patch in patches])
    low, high = points.min(axis=0), points.max(axis=0)
    wall = draft.walls[rng.integers(len(draft.walls))]
    width = 2 * float(np.abs([low[0], high[0]]).max())
    spot = wall.free_spot(rng, width, height + low[2], height + high[2])
    if spot is not None:
        wall.take(spot, width, height + low[2], height + high[2])
        draft.patches += draft.space.on_wall(patches, wall.index, spot, height)
