"""Which pieces stand where: a whole random room.

World frame: metres, z up, the floor at z = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch
from room2dgs.tools.random_rooms import (
    bathroom,
    extras,
    fittings,
    floor_plans,
    kitchen,
    materials,
    openings,
    seats,
    shell,
    storage,
    tables,
)
from room2dgs.tools.random_rooms.clutter import LARGE, SMALL
from room2dgs.tools.random_rooms.draft import Draft
from room2dgs.tools.random_rooms.shapes import extent, moved
from room2dgs.tools.random_rooms.shell import Opening, Space
from room2dgs.tools.random_rooms.style import random_style
from room2dgs.tools.random_rooms.themes import Theme, random_theme

Rng = np.random.Generator
AT_WALL = (
    seats.sofa,
    seats.bed,
    seats.armchair,
    tables.desk,
    tables.tv_board,
    extras.workplace,
    extras.steps,
    extras.podium,
    storage.shelf,
    storage.cupboard,
    storage.fridge,
    kitchen.kitchen_run,
    bathroom.bathtub,
    bathroom.toilet,
    bathroom.washbasin,
    bathroom.shower,
    bathroom.washer,
)
MOST_PATCHES = 4500  # no more pieces are added beyond


@dataclass(frozen=True)
class RandomRoom:
    """A room's geometry.

    Attributes:
        patches: all surfaces; at least one has an emitter's material.
        inside: points (N, 3) -> (N,) bool, in the free air of the main space's shell, furniture ignored.
        height: metres, of the ceiling at its highest.
        blocked: points (N, 3) -> (N,) bool, within the bounding box of a large piece.
        bounds: lowest and highest corner (2, 3) of the main space.
        storm: shapes fly about in it, as in no real room.
        spaces: the main space, and those behind its doorways.
    """

    patches: list[Patch]
    inside: Callable[[np.ndarray], np.ndarray]
    height: float
    blocked: Callable[[np.ndarray], np.ndarray]
    bounds: np.ndarray
    storm: bool
    spaces: tuple[Space, ...] = ()


def random_room(rng: Rng) -> RandomRoom:
    """Draws a room: shell, openings, lights, furniture, clutter. The same state of `rng` gives the same room."""
    outline = floor_plans.random_outline(rng)
    profile = floor_plans.random_profile(rng, float(outline[:, 1].max()))
    draft = Draft(Space(outline, profile), random_style(rng))
    theme = random_theme(rng)
    others = [openings.doorway(rng, draft) for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.4, 0.35, 0.18, 0.07])))]
    light = materials.daylight(rng)
    for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.25, 0.4, 0.25, 0.1]))):
        openings.window(rng, draft, light)
    for _ in range(int(rng.choice([0, 1, 2], p=[0.8, 0.15, 0.05]))):
        openings.niche(rng, draft)
    lamps(rng, draft)
    built_in(rng, draft)
    storm = rng.random() < 0.09
    if storm:
        whirl(rng, draft)
    amount = rng.beta(2.0, 0.9) * (0.3 if storm else 1.0)
    if rng.random() < 0.06:
        amount = 0.0
    fill(rng, draft, theme, amount)
    covers = shell.wall_materials(rng, len(outline), theme.cover)
    patches = clad(rng, draft, covers) + draft.patches
    for other in others:
        if other is not None:
            patches += neighbour(rng, other, light)
    height = float(draft.space.profile[:, 1].max())
    bounds = np.array([[*outline.min(axis=0), 0.0], [*outline.max(axis=0), height]])
    spaces = draft.space, *(other.space for other in others if other is not None)
    return RandomRoom(patches, draft.space.encloses, height, draft.plan.blocked, bounds, storm, spaces)


def clad(rng: Rng, draft: Draft, covers: list[Material]) -> list[Patch]:
    """Floor, walls, ceiling, skirting boards and mouldings."""
    space, style = draft.space, draft.style
    patches = shell.space_patches(space, materials.floor(rng), materials.ceiling(rng), covers)
    board = style.wood if rng.random() < 0.5 else style.plain
    if rng.random() < 0.7:
        tall, thick = rng.uniform(0.04, 0.14), rng.uniform(0.008, 0.02)
        for index in range(len(space.outline)):
            patches += shell.skirting(space, index, tall, thick, board)
    if rng.random() < 0.12 and np.ptp(space.profile[:, 1]) == 0:
        patches += shell.moulding(rng, space, board)
    return patches


def neighbour(rng: Rng, draft: Draft, light: Material) -> list[Patch]:
    """The space behind a doorway, with its own light and a few pieces."""
    if rng.random() < 0.4:
        openings.window(rng, draft, light)
    lit = any(patch.material.kind == "emitter" for patch in draft.patches)
    if not lit or rng.random() < 0.3:
        lamps(rng, draft, 1)
    fill(rng, draft, random_theme(rng), 0.6 * rng.beta(1.2, 1.5))
    return clad(rng, draft, shell.wall_materials(rng, len(draft.space.outline))) + draft.patches


def lamps(rng: Rng, draft: Draft, count: int | None = None) -> None:
    """Lamps at the ceiling and standing; one at least where no window shines."""
    lit = any(patch.material.kind == "emitter" for patch in draft.patches)
    if count is None:
        chances = [0.3, 0.45, 0.18, 0.07] if lit else [0.0, 0.6, 0.28, 0.12]
        count = int(rng.choice(4, p=chances))
    low, high = draft.space.outline.min(axis=0), draft.space.outline.max(axis=0)
    margin = np.minimum(0.4, 0.3 * (high - low))
    light = materials.lamp(rng)
    for _ in range(200):
        if count <= 0:
            break
        spot = rng.uniform(low + margin, high - margin)
        top = float(draft.space.top(spot[1]))
        if not draft.space.contains(spot[None])[0] or top < 1.7:
            continue
        if rng.random() < 0.15 and draft.plan.place(rng, draft, fittings.floor_lamp(rng, draft.style, light)):
            count -= 1
            continue
        level = draft.space.top(spot[1] + 0.2) == draft.space.top(spot[1] - 0.2)
        lamp = fittings.ceiling_lamp(rng, draft.style, light, hanging=not level)
        yaw = float(rng.choice([0.0, np.pi / 2, rng.uniform(0, 3)]))
        draft.patches += moved(lamp, (*spot, top), yaw)
        draft.plan.keep_box(lamp, (*spot, top), yaw)
        count -= 1


def built_in(rng: Rng, draft: Draft) -> None:
    """Beams, pillars, panelling, pipes."""
    space, style = draft.space, draft.style
    flat = np.ptp(space.profile[:, 1]) == 0
    if flat and len(space.outline) == 4 and not draft.behind and rng.random() < 0.15:
        draft.patches += shell.ceiling_beams(rng, space, style.wood if rng.random() < 0.6 else style.plain)
    if flat and rng.random() < 0.12:
        column = shell.pillar(rng, float(space.profile[0, 1]) - 1e-4, style.plain)
        draft.plan.place(rng, draft, column)
    for wall in draft.walls:
        if rng.random() < 0.04 and not space.openings.get(wall.index):
            board = extras.panelling(rng, wall.length, style)
            if wall.height(wall.length / 2, wall.length) > 1.4:
                draft.patches += space.on_wall(board, wall.index, 0.0)
    if rng.random() < 0.15:
        wall = draft.walls[rng.integers(len(draft.walls))]
        pipe = fittings.pipes(rng, style, wall.height(wall.length / 2, 0.3))
        hang(rng, draft, pipe, 0.0)


def fill(rng: Rng, draft: Draft, theme: Theme, amount: float) -> None:
    """Furniture at the walls and in the middle, things on the walls, rugs, clutter on the floor.

    Args:
        amount: 0 (empty) to 1 (crammed).
    """
    plan, style = draft.plan, draft.style

    def full() -> bool:
        return len(draft.patches) > MOST_PATCHES

    if rng.random() < 0.35:
        hang_door(rng, draft)
    for _ in range(int(rng.poisson(0.5 * min(1.0, 3 * amount)))):
        plan.place(rng, draft, fittings.rug(rng, style), flat=True)
    for build, chance in theme.first:
        if rng.random() < chance * min(1.0, 2.5 * amount) and not full():
            put = plan.place_at_wall if build in AT_WALL else plan.place
            put(rng, draft, build(rng, style))
    for _ in range(int(rng.poisson(amount * (1.5 + 0.5 * plan.area)))):
        if theme.walls and not full():
            plan.place_at_wall(rng, draft, theme.walls[rng.integers(len(theme.walls))](rng, style))
    for _ in range(int(rng.poisson(amount * (0.6 + 0.2 * plan.area)))):
        if theme.middle and not full():
            plan.place(rng, draft, theme.middle[rng.integers(len(theme.middle))](rng, style))
    decorate(rng, draft, amount)
    for _ in range(int(rng.poisson(style.mess * min(1.0, 2 * amount) * 0.6 * plan.area))):
        things = LARGE if rng.random() < 0.7 else SMALL
        if not full():
            plan.place(rng, draft, things[rng.integers(len(things))](rng))


def decorate(rng: Rng, draft: Draft, amount: float) -> None:
    """Pictures, boards, switches on the walls."""
    style = draft.style
    for _ in range(int(rng.poisson(0.5 + 3 * amount))):
        hang(rng, draft, fittings.picture(rng, style), rng.uniform(0.9, 1.6))
    for _ in range(int(rng.poisson(0.7 * amount))):
        hang(rng, draft, storage.wall_board(rng, style), rng.uniform(1.0, 1.7))
    for _ in range(int(rng.poisson(1.0))):
        hang(rng, draft, fittings.sockets(rng, style), rng.choice([0.2, 1.05]))


def whirl(rng: Rng, draft: Draft) -> None:
    """A storm of shapes: on the floor, in the air, half in the walls."""
    low, high = draft.space.outline.min(axis=0), draft.space.outline.max(axis=0)
    for _ in range(int(rng.integers(15, 110))):
        thing = extras.storm_shape(rng)
        spot = rng.uniform(low, high)
        top = float(draft.space.top(spot[1]))
        z = 0.0 if rng.random() < 0.5 else rng.uniform(0, top - 0.2)
        if draft.space.contains(spot[None])[0] and len(draft.patches) < MOST_PATCHES:
            draft.patches += moved(thing, (*spot, z), 0.0)
            draft.plan.keep_box(thing, (*spot, z), 0.0)


def hang_door(rng: Rng, draft: Draft) -> None:
    """A closed door on a wall, and where it is."""
    patches = fittings.closed_door(rng, draft.style)
    place = hang(rng, draft, patches, 0.0)
    if place is not None:
        wall, spot = place
        low, high = extent([patch for patch in patches if patch.tag != "frame"])
        door = Opening(spot + float(low[0]), spot + float(high[0]), 0.0, float(high[2]), "door")
        draft.space.mounted.setdefault(wall, []).append(door)


def hang(rng: Rng, draft: Draft, patches: list[Patch], height: float) -> tuple[int, float] | None:
    """Fixes a piece to a free stretch of a random wall, its z = 0 at `height`; nothing if there is no room.

    Returns:
        The wall and how far along it the piece's middle is; None: there was no room.
    """
    low, high = extent(patches)
    wall = draft.walls[rng.integers(len(draft.walls))]
    width = 2 * float(np.abs([low[0], high[0]]).max())
    spot = wall.free_spot(rng, width, height + low[2], height + high[2])
    if spot is None:
        return None
    wall.take(spot, width, height + low[2], height + high[2])
    draft.patches += draft.space.on_wall(patches, wall.index, spot, height)
    return wall.index, spot
