"""Which pieces stand where: the whole room for a seed.

World frame: metres, z up, the room fills the box from 0 to `SIZE`. Walls are numbered 0 (y = 0),
1 (x = SIZE[0]), 2 (y = SIZE[1]), 3 (x = 0); each has a frame with x along the wall, y into the room.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from room2dgs.demo_room import furniture, palette
from room2dgs.demo_room.geometry import EMITTER, Material, Patch, box, cylinder, disc, parallelogram, placed

SIZE = np.array([4.5, 3.5, 2.6])
WALL_KINDS = ("flowers", "bricks", "stripes", "cracked")


def wall_length(wall: int) -> float:
    """Metres along a wall."""
    return float(SIZE[wall % 2])


def on_wall(patches: list[Patch], wall: int, along: float, height: float = 0.0) -> list[Patch]:
    """Moves a piece from its local frame to `along` metres from a wall's start, `height` above the floor."""
    start = np.array([(0, 0), (SIZE[0], 0), (SIZE[0], SIZE[1]), (0, SIZE[1])][wall], float)
    direction = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)][wall], float)
    origin = start + along * direction
    return placed(patches, (origin[0], origin[1], height), wall * np.pi / 2)


def room_patches(seed: int, blank_walls: int) -> list[Patch]:
    """All surfaces of the room.

    Args:
        seed: fixes the arrangement, the sizes and the colours.
        blank_walls: this many walls are uniform paint without pictures; all else stays as it is.
    """
    rng = np.random.default_rng([seed, 1])
    bare = set(np.random.default_rng([seed, 2]).permutation(4)[:blank_walls].tolist())
    patches = shell(rng, bare)
    for piece in (*wall_pieces(rng, bare), centre_pieces(rng), ceiling_lamp()):
        patches += piece
    return patches


def shell(rng: np.random.Generator, bare: set[int]) -> list[Patch]:
    """Floor, ceiling, walls and skirting boards."""
    x, y, z = np.diag(SIZE)
    patches = [parallelogram((0, 0, 0), x, y, palette.floor(rng), "floor")]
    patches.append(parallelogram(z, y, x, Material("ceiling", ((0.80, 0.79, 0.75),)), "ceiling"))
    kinds = rng.permutation(WALL_KINDS)
    board = palette.wood(rng)
    for wall in range(4):
        length, papered = wall_length(wall), palette.wall(rng, str(kinds[wall]))
        material = palette.wall(rng, "paint")
        material = material if wall in bare else papered
        side = parallelogram((length, 0, 0), (-length, 0, 0), (0, 0, SIZE[2]), material, f"wall{wall}")
        skirting = box((0, 0, 0), (length, 0.014, 0.08), board, "skirting")
        patches += on_wall([side, *skirting], wall, 0.0)
    return patches


def wall_pieces(rng: np.random.Generator, bare: set[int]) -> list[list[Patch]]:
    """What stands along and hangs on the walls."""
    long_first, short_first = int(rng.choice([0, 2])), int(rng.choice([1, 3]))
    seat, store, light, entry = long_first, 2 - long_first, short_first, 4 - short_first
    pieces = []

    def picture(wall: int, along: float, height: float, width: float, tall: float, material: Material) -> None:
        """Hangs one on a papered wall; drawn for a bare one too, so that nothing else changes."""
        patches = furniture.picture(rng, width, tall, material)
        if wall not in bare:
            pieces.append(on_wall(patches, wall, along, height))

    along = wall_length(seat) / 2 + rng.uniform(-0.25, 0.25)
    build = furniture.bed if rng.random() < 0.35 else furniture.sofa
    pieces.append(on_wall(build(rng, rng.uniform(1.8, 2.05)), seat, along))
    pieces.append(on_wall(furniture.floor_lamp(rng), seat, along - 1.4, 0.0))
    pieces[-1] = placed(pieces[-1], tuple(0.3 * inward(seat)), 0.0)
    picture(seat, along - 0.45, 1.2, 0.8, 0.6, palette.painting(rng))
    picture(seat, along + 0.5, 1.25, 0.5, 0.7, palette.poster(rng))

    along = 0.95 + rng.uniform(0.0, 0.15)
    width = rng.uniform(1.0, 1.3)
    pieces.append(on_wall(furniture.shelf(rng, width, rng.uniform(1.75, 2.0)), store, along))
    cupboard_along = wall_length(store) - 0.8 - rng.uniform(0.0, 0.2)
    pieces.append(
        on_wall(furniture.cupboard(rng, rng.uniform(0.85, 1.0), rng.uniform(1.45, 1.7)), store, cupboard_along)
    )
    picture(store, (along + cupboard_along + 0.1) / 2, 1.05, 0.6, 0.85, palette.poster(rng))

    along = wall_length(light) / 2 + rng.uniform(-0.2, 0.2)
    width = rng.uniform(1.0, 1.3)
    pieces.append(on_wall(furniture.window(rng, width, 1.05), light, along, 1.05))
    pieces.append(on_wall(furniture.curtains(rng, width + 0.2, 2.25), light, along))
    pieces.append(placed(on_wall(furniture.pouf(rng), light, along + 0.35), tuple(0.45 * inward(light)), 0.0))
    pieces.append(placed(on_wall(furniture.cartons(rng), light, along - 0.4), tuple(0.42 * inward(light)), 0.0))

    along = 0.62 if rng.random() < 0.5 else wall_length(entry) - 0.62
    pieces.append(on_wall(furniture.door(rng), entry, along))
    along = wall_length(entry) / 2 + (0.55 if along < 1 else -0.55)
    pieces.append(on_wall(furniture.dresser(rng, rng.uniform(1.0, 1.2)), entry, along))
    picture(entry, along + 0.1, 1.35, 0.75, 0.55, palette.painting(rng))
    return pieces


def inward(wall: int) -> np.ndarray:
    """(3,) unit vector from a wall into the room."""
    return np.array([(0, 1, 0), (-1, 0, 0), (0, -1, 0), (1, 0, 0)][wall], float)


def centre_pieces(rng: np.random.Generator) -> list[Patch]:
    """The rug, the table and its chairs, in the middle of the room."""
    centre = SIZE / 2 * (1, 1, 0) + (*rng.uniform(-0.1, 0.1, 2), 0)
    yaw = rng.uniform(-0.15, 0.15)
    width, depth = rng.uniform(1.0, 1.2), rng.uniform(0.65, 0.75)
    patches = furniture.carpet(rng, 2.1, 1.4)
    patches += placed(furniture.table(rng, width, depth), (0, 0, 0.008), 0.0)
    wood, seat = palette.wood(rng), palette.cloth(rng)
    for x, y, turn in ((-0.2 * width, -1, 0.0), (0.2 * width, 1, np.pi), (1, 0, np.pi / 2)):
        reach = np.array([np.sign(x) * (width / 2 + 0.18) if y == 0 else x, y * (depth / 2 + 0.18)])
        reach += rng.uniform(-0.04, 0.04, 2)
        patches += placed(furniture.chair(rng, wood, seat), (*reach, 0.008), turn + rng.uniform(-0.25, 0.25))
    return placed(patches, tuple(centre), yaw)


def ceiling_lamp() -> list[Patch]:
    """A flat round lamp on the ceiling: a metal rim and a glaring disc facing down."""
    centre = SIZE * (0.5, 0.5, 1.0) - (0.0, 0.0, 0.06)
    rim, top, bottom = cylinder(centre, 0.24, 0.06, palette.DARK_METAL, "lamp rim")
    glare = disc(centre - (0, 0, 0.004), -0.22, EMITTER, "light")
    return [rim, top, replace(bottom, material=palette.DARK_METAL), glare]
