"""Groups and built-in things: dining groups, steps, podiums, heaps of boxes, panelling, storms of shapes."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Patch, box
from room2dgs.tools.random_rooms import clutter, materials, seats, tables
from room2dgs.tools.random_rooms.clutter import LARGE, scatter
from room2dgs.tools.random_rooms.shapes import bar, block, extent, moved, resting, rod, rotation
from room2dgs.tools.random_rooms.style import Style, carcass

Rng = np.random.Generator


def dining_group(rng: Rng, style: Style) -> list[Patch]:
    """A table with equal or mixed chairs around it, pushed in or pulled out."""
    patches = tables.table(rng, style)
    solid = [patch for patch in patches if patch.tag == "table"]
    half = extent(solid)[1][:2]
    same = rng.random(2)[0] < 0.75
    kind = (seats.chair, seats.chair, seats.stool)[rng.integers(3)]
    seed = int(rng.integers(1 << 30))
    for side, axis in ((-1, 1), (1, 1), (-1, 0), (1, 0)):
        if rng.random() < 0.2:
            continue
        places = max(1, int(half[1 - axis] / 0.4)) if axis == 1 else 1
        for k in range(places):
            chair = kind(np.random.default_rng(seed) if same else rng, style)
            spot = np.zeros(2)
            spot[1 - axis] = (k - (places - 1) / 2) * 2 * half[1 - axis] / max(places, 1)
            spot[axis] = side * (half[axis] + rng.uniform(0.0, 0.35))
            yaw = {(-1, 1): 0.0, (1, 1): np.pi, (-1, 0): -np.pi / 2, (1, 0): np.pi / 2}[side, axis]
            patches += moved(chair, (*spot, 0), yaw + rng.normal(0, 0.1 + style.turn))
    return patches


def workplace(rng: Rng, style: Style) -> list[Patch]:
    """A desk at the wall with a chair before it."""
    patches = tables.desk(rng, style)
    depth = 0.7
    chair = seats.office_chair(rng, style) if rng.random() < 0.7 else seats.chair(rng, style)
    spot = (rng.uniform(-0.25, 0.25), depth + rng.uniform(0.05, 0.5), 0)
    return patches + moved(chair, spot, np.pi + rng.normal(0, 0.5))


def steps(rng: Rng, style: Style) -> list[Patch]:
    """A straight flight of steps along the wall."""
    rise, tread, depth = rng.uniform(0.15, 0.2), rng.uniform(0.22, 0.3), rng.uniform(0.7, 1.1)
    count = int(rng.integers(2, 9))
    riser, top = carcass(rng, style), carcass(rng, style)
    patches = []
    for k in range(count):
        low, high = (k * tread, 0.002, 0.0), ((k + 1) * tread, depth, (k + 1) * rise)
        patches += box(low, high, riser, "step", top=top)
    return moved(patches, (-count * tread / 2, 0, 0))


def podium(rng: Rng, style: Style) -> list[Patch]:
    """A low platform at the wall, or a boxed-in ledge, with things on it."""
    width, depth, height = rng.uniform(0.5, 2.0), rng.uniform(0.15, 1.0), rng.uniform(0.12, 0.9)
    patches = box((-width / 2, 0.0, 0), (width / 2, depth, height), carcass(rng, style), "podium")
    return patches + scatter(rng, (-width / 2, 0), (width / 2, depth), height, 3 * style.mess * width, LARGE)


def heap(rng: Rng, style: Style) -> list[Patch]:
    """Boxes, bags and shapes piled up about the origin."""
    patches: list[Patch] = []
    reach = rng.uniform(0.25, 0.6)
    for _ in range(int(rng.integers(3, 12))):
        thing = LARGE[rng.integers(len(LARGE))](rng)
        tall = float(extent(thing)[1][2])
        spot = rng.normal(0, 0.4 * reach, 2)
        base = 0.0
        if patches and rng.random() < 0.6:
            below = [p for p in patches if (np.abs(p.grid[..., :2].mean(axis=(0, 1)) - spot) < 0.15).all()]
            base = max((float(p.grid[..., 2].max()) for p in below), default=0.0)
        if base + tall < 1.6:
            patches += moved(thing, (*spot, base), rng.uniform(-3, 3))
    return patches or clutter.carton(rng)


def panelling(rng: Rng, length: float, style: Style) -> list[Patch]:
    """Boards over a wall's lower part with a rail, in the wall's frame (x from 0 to `length`)."""
    height = rng.uniform(0.7, 1.3)
    cover = carcass(rng, style)
    patches = box((0, 0, 0), (length, 0.012, height), cover, "panelling")
    patches += box((0, 0, height), (length, 0.03, height + 0.03), cover, "panelling")
    if rng.random() < 0.6:
        for x in np.arange(rng.uniform(0.1, 0.4), length - 0.05, rng.uniform(0.15, 0.7)):
            patches += box((x, 0.012, 0.1), (x + 0.03, 0.022, height), cover, "panelling")
    return patches


def storm_shape(rng: Rng) -> list[Patch]:
    """A random primitive of 5 cm to 1 m, in any orientation, its lowest point on z = 0."""
    size = float(np.exp(rng.uniform(np.log(0.05), np.log(0.5))))
    return resting(clutter.shape(rng, size), rotation(*rng.uniform(-3.1, 3.1, 3)))


def laundry_rack(rng: Rng, style: Style) -> list[Patch]:
    """A folding rack with cloths over its bars, about the origin."""
    width, height = rng.uniform(0.6, 1.2), rng.uniform(0.8, 1.1)
    patches: list[Patch] = []
    for x in (-width / 2, width / 2):
        patches += bar((x, -0.3, 0), (x, 0.3, height), 0.02, style.metal, "rack")
        patches += bar((x, 0.3, 0), (x, -0.3, height), 0.02, style.metal, "rack")
    for y in np.linspace(-0.3, 0.3, 6):
        patches.append(rod((-width / 2, y, height), (width / 2, y, height), 0.005, style.metal, "rack"))
        if rng.random() < 0.6:
            wide, drop = rng.uniform(0.15, 0.5), rng.uniform(0.2, 0.6)
            x = rng.uniform(-width / 2, width / 2 - wide)
            low, high = (x, y - 0.008, height - drop), (x + wide, y + 0.008, height + 0.008)
            patches += box(low, high, materials.cloth(rng), "cloth")
    return patches


def ladder(rng: Rng, style: Style) -> list[Patch]:
    """A ladder, a board or a mattress leaning at the wall."""
    height, lean = rng.uniform(1.2, 2.1), rng.uniform(0.12, 0.4)
    width = rng.uniform(0.35, 0.9)
    turn = rotation(0, 0, lean)
    if rng.random() < 0.5:
        thing: list[Patch] = []
        wood = carcass(rng, style)
        for x in (-width / 2, width / 2):
            thing += moved(block(0.05, 0.03, height, wood, "ladder"), (x, 0, 0))
        for z in np.arange(0.2, height, 0.28):
            thing += moved(block(width, 0.025, 0.04, wood, "ladder"), (0, 0, z))
    else:
        thing = block(width, rng.uniform(0.01, 0.18), height, materials.anything(rng), "board")
    thing = moved(thing, (0, 0, 0), turn)
    low, _ = extent(thing)
    return moved(thing, (0, 0.01 - low[1], -low[2]))
