"""Small things: bottles, cups, bowls, books, boxes, balls, papers, cloths, and shapes without a name."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Patch
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.shapes import (
    block,
    cushion,
    ellipsoid,
    lathe,
    moved,
    prism,
    resting,
    rotation,
    rounded_box,
    tube,
)

Rng = np.random.Generator
GLAZES = (materials.ceramic, materials.plastic, materials.glass_like, materials.metal, materials.painted)


def glaze(rng: Rng):
    """Material of a vessel."""
    return GLAZES[rng.integers(len(GLAZES))](rng)


def bottle(rng: Rng) -> list[Patch]:
    """A bottle, a flask or a vase: a smooth lathe profile with shoulders and a neck."""
    height, radius = rng.uniform(0.12, 0.36), rng.uniform(0.025, 0.055)
    neck, shoulder = rng.uniform(0.25, 0.7) * radius, rng.uniform(0.45, 0.75)
    t = np.linspace(0, 1, 6)
    ease = 3 * t**2 - 2 * t**3
    curve = np.column_stack([radius + (neck - radius) * ease, height * (shoulder + (0.88 - shoulder) * t)])
    profile = [(0, 0), (radius, 0), *curve, (neck, height), (0, height)]
    return [lathe(profile, glaze(rng), "bottle")]


def cup(rng: Rng) -> list[Patch]:
    """An open cup, mug or pot, at times with a handle."""
    height, radius = rng.uniform(0.06, 0.13), rng.uniform(0.03, 0.06)
    foot, wall = radius * rng.uniform(0.55, 1.0), 0.004
    profile = [(0, 0), (foot, 0), (radius, height), (radius - wall, height), (foot - wall, 0.008), (0, 0.008)]
    material = glaze(rng)
    patches = [lathe(profile, material, "cup")]
    if rng.random() < 0.6:
        angle = np.linspace(-1.3, 1.3, 7)
        side = 0.5 * (foot + radius)
        loop = np.column_stack(
            [side + 0.32 * height * np.cos(angle) - 0.005, 0 * angle, 0.5 * height + 0.32 * height * np.sin(angle)]
        )
        patches.append(tube(loop, 0.005, material, "cup", 8))
    return patches


def bowl(rng: Rng) -> list[Patch]:
    """A bowl or a plate, at times with fruit."""
    radius = rng.uniform(0.06, 0.17)
    height = radius * rng.uniform(0.12, 0.7)
    t = np.linspace(0, 1, 7)
    outer = np.column_stack([radius * (0.4 + 0.6 * np.sin(t * np.pi / 2)), height * (1 - np.cos(t * np.pi / 2))])
    inner = outer[::-1] * (0.96, 1.0) + (0, 0.006)
    patches = [lathe([(0, 0), *outer, *inner, (0, inner[-1][1])], glaze(rng), "bowl")]
    if rng.random() < 0.35 and height > 0.04:
        for _ in range(int(rng.integers(1, 5))):
            size = rng.uniform(0.025, 0.04)
            spot = rng.uniform(-0.4, 0.4, 2) * radius
            fruit = ellipsoid((size, size, size * rng.uniform(0.8, 1.1)), materials.plastic(rng), "fruit")
            patches += moved([fruit], (*spot, 0.5 * height + size * 0.6))
    return patches


def book_pile(rng: Rng) -> list[Patch]:
    """One to six books on one another."""
    patches, z = [], 0.0
    for _ in range(int(rng.integers(1, 7))):
        cover = materials.book(rng)
        thick = rng.uniform(0.008, 0.045)
        pages = materials.painted(rng)
        one = block(rng.uniform(0.13, 0.3), rng.uniform(0.1, 0.22), thick, cover, "book", left=pages, back=pages)
        patches += moved(one, (0, 0, z), rng.uniform(-0.5, 0.5))
        z += thick
    return patches


def papers(rng: Rng) -> list[Patch]:
    """Sheets and magazines."""
    patches = []
    for k in range(int(rng.integers(1, 4))):
        sheet = block(0.21, 0.297, rng.uniform(0.001, 0.006), materials.picture(rng), "paper")
        patches += moved(sheet, (*rng.uniform(-0.08, 0.08, 2), 0.001 * k), rng.uniform(-3, 3))
    return patches


def carton(rng: Rng) -> list[Patch]:
    """A closed box, or an open one with flaps."""
    width, depth, height = rng.uniform(0.08, 0.45), rng.uniform(0.08, 0.35), rng.uniform(0.04, 0.35)
    material = materials.cardboard(rng) if rng.random() < 0.6 else materials.anything(rng)
    if rng.random() < 0.75 or width < 0.2:
        return block(width, depth, height, material, "carton")
    return open_box(width, depth, height, 0.005, material, "carton")


def open_box(width: float, depth: float, height: float, wall: float, material, tag: str) -> list[Patch]:
    """A box without a lid."""
    x, y = width / 2 - wall / 2, depth / 2 - wall / 2
    patches = block(width, depth, wall, material, tag)
    for side in (-1, 1):
        patches += moved(block(wall, depth, height - wall, material, tag), (side * x, 0, wall))
        patches += moved(block(width - 2 * wall, wall, height - wall, material, tag), (0, side * y, wall))
    return patches


def ball(rng: Rng) -> list[Patch]:
    """A ball or an egg."""
    radius = rng.uniform(0.025, 0.13)
    return resting([ellipsoid((radius, radius, radius * rng.uniform(0.8, 1.2)), materials.anything(rng), "ball")])


def pillow(rng: Rng) -> list[Patch]:
    """A soft square cushion, lying or leaning."""
    size = rng.uniform(0.3, 0.55)
    soft = cushion(size, size * rng.uniform(0.7, 1), rng.uniform(0.09, 0.18), materials.cloth(rng))
    return resting(soft, rotation(rng.uniform(-3, 3), rng.normal(0, 0.35), rng.normal(0, 0.35)))


def cloth_heap(rng: Rng) -> list[Patch]:
    """A crumpled cloth: a smooth bumpy mound."""
    size, n = rng.uniform(0.12, 0.4), 14
    u, v = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    edge = np.clip(1 - np.maximum(np.abs(u), np.abs(v)) ** 3, 0, 1)
    bumps = sum(
        rng.uniform(0.2, 1) * np.sin(rng.uniform(1, 4) * u + rng.uniform(1, 4) * v + rng.uniform(0, 6))
        for _ in range(4)
    )
    height = size * rng.uniform(0.1, 0.3) * edge * np.clip(0.7 + 0.35 * bumps, 0.05, None)
    grid = np.stack([size * u * np.sqrt(1 - v**2 / 3), size * v * np.sqrt(1 - u**2 / 3), height + 0.002], -1)
    return [Patch(grid, (2 * size, 2 * size), materials.cloth(rng), "cloth")]


def cable(rng: Rng) -> list[Patch]:
    """A cable lying in curves."""
    n = 14
    heading = np.cumsum(rng.normal(0, 0.6, n))
    step = rng.uniform(0.03, 0.06)
    points = np.column_stack([np.cumsum(np.cos(heading)), np.cumsum(np.sin(heading))]) * step
    points -= points.mean(axis=0)
    radius = rng.uniform(0.003, 0.007)
    return [tube(np.column_stack([points, np.full(n, radius)]), radius, materials.plastic(rng), "cable", 8)]


def tool(rng: Rng) -> list[Patch]:
    """A long thing: a pen, a spoon, a stick, a tool with a head."""
    length, radius = rng.uniform(0.1, 0.35), rng.uniform(0.004, 0.014)
    material = materials.anything(rng)
    patches = [lathe([(0, 0), (radius, 0), (radius, length), (0, length)], material, "tool")]
    if rng.random() < 0.5:
        head = block(
            rng.uniform(2, 7) * radius, rng.uniform(2, 4) * radius, rng.uniform(2, 8) * radius, material, "tool"
        )
        patches += moved(head, (0, 0, length))
    return resting(patches, rotation(rng.uniform(-3, 3), np.pi / 2, 0.0))


def cone(half: np.ndarray, material) -> Patch:
    """A blunt cone about the origin."""
    profile = [(0, -half[2]), (half[0], -half[2]), (half[1] * 0.4, half[2]), (0, half[2])]
    return lathe(profile, material, "shape")


def turned_shape(rng: Rng, half: np.ndarray, material) -> list[Patch]:
    """A wavy solid of revolution about the origin."""
    return moved([lathe(random_profile(rng, half[0], 2 * half[2]), material, "shape")], (0, 0, -half[2]))


def edged_shape(rng: Rng, half: np.ndarray, material) -> list[Patch]:
    """An uneven prism of three to eight sides about the origin."""
    count = int(rng.integers(3, 9))
    angle = np.sort(rng.uniform(0, 2 * np.pi / count * 0.7, count) + np.arange(count) * 2 * np.pi / count)
    outline = half[0] * np.column_stack([np.cos(angle), np.sin(angle)])
    return moved(prism(outline, 2 * half[2], material, "shape"), (0, 0, -half[2]))


def bent_shape(rng: Rng, size: float, material) -> Patch:
    """A bow, ring or spiral of tube about the origin."""
    t = np.linspace(0, rng.uniform(2, 7), 20)
    points = size * np.column_stack([0.8 * np.cos(t), 0.8 * np.sin(t), rng.uniform(0, 0.2) * t])
    return tube(points, size * rng.uniform(0.06, 0.2), material, "shape")


def shape(rng: Rng, size: float | None = None) -> list[Patch]:
    """A random primitive of about `size` metres about the origin, of one of seven kinds."""
    size = size or rng.uniform(0.04, 0.2)
    half = size * rng.uniform(0.3, 1.0, 3)
    material = materials.anything(rng)
    kinds = (
        lambda: moved(block(2 * half[0], 2 * half[1], 2 * half[2], material, "shape"), (0, 0, -half[2])),
        lambda: [rounded_box(half, half.min() * rng.uniform(0.2, 1.0), material, "shape")],
        lambda: [ellipsoid(half, material, "shape")],
        lambda: [cone(half, material)],
        lambda: turned_shape(rng, half, material),
        lambda: edged_shape(rng, half, material),
        lambda: [bent_shape(rng, size, material)],
    )
    return kinds[rng.integers(7)]()


def random_profile(rng: Rng, radius: float, height: float) -> np.ndarray:
    """(N, 2) smooth random lathe profile from the axis to the axis."""
    z = np.linspace(0, 1, 12)
    wave = 1 + sum(rng.normal(0, 0.25 / k) * np.sin(k * np.pi * z + rng.uniform(0, 6)) for k in (1, 2, 3))
    outline = np.column_stack([radius * np.clip(wave, 0.15, None), height * z])
    return np.concatenate([[[0, 0]], outline, [[0, height]]])


def resting_shape(rng: Rng) -> list[Patch]:
    """A random primitive lying in any orientation."""
    return resting(shape(rng), rotation(*rng.uniform(-3, 3, 3)))


def basket(rng: Rng) -> list[Patch]:
    """A round bin or basket, open above."""
    height, radius, wall = rng.uniform(0.15, 0.5), rng.uniform(0.1, 0.25), 0.008
    foot = radius * rng.uniform(0.6, 1.0)
    profile = [(0, 0), (foot, 0), (radius, height), (radius - wall, height), (foot - wall, wall), (0, wall)]
    return [lathe(profile, materials.anything(rng), "basket")]


def bag(rng: Rng) -> list[Patch]:
    """A limp bag: a narrow rounded box, its top drawn in, with handles."""
    width, depth, height = rng.uniform(0.25, 0.5), rng.uniform(0.1, 0.25), rng.uniform(0.25, 0.5)
    material = materials.cloth(rng) if rng.random() < 0.6 else materials.plastic(rng)
    body = rounded_box((width / 2, depth / 2, height / 2), 0.4 * depth, material, "bag")
    grid = body.grid.copy()
    share = (grid[..., 2] + height / 2) / height
    grid[..., 1] *= 1 - rng.uniform(0.3, 0.7) * share
    body = Patch(grid, body.size, material, "bag")
    t = np.linspace(0, np.pi, 9)
    loop = np.column_stack([0.12 * np.cos(t), 0 * t, 0.45 * height + 0.14 * np.sin(t)])
    return resting([body, tube(loop, 0.008, material, "bag", 8)], rotation(rng.uniform(-3, 3), 0, rng.normal(0, 0.1)))


def shoe(rng: Rng) -> list[Patch]:
    """A pair of low rounded things."""
    material = materials.anything(rng)
    patches = []
    for x in (-0.06, 0.06):
        sole = rounded_box((0.045, 0.13, 0.03), 0.028, material, "shoe")
        ankle = rounded_box((0.042, 0.06, 0.05), 0.03, material, "shoe")
        patches += moved([sole], (x, 0, 0.03)) + moved([ankle], (x, -0.06, 0.06))
    return patches


def leaf_sheet(rng: Rng) -> list[Patch]:
    """A stiff board leaning at a slant: a frame, a tray or a laptop's lid."""
    width, height = rng.uniform(0.15, 0.5), rng.uniform(0.12, 0.4)
    board = block(width, 0.012, height, materials.picture(rng), "board")
    return resting(board, rotation(rng.uniform(-3, 3), 0.0, rng.uniform(-1.3, -0.2)))


SMALL = (
    *(bottle, bottle, cup, cup, bowl, book_pile, papers, carton, ball, tool, resting_shape, resting_shape, cable),
    *(cloth_heap, leaf_sheet),
)
LARGE = (carton, carton, bag, basket, pillow, ball, book_pile, cloth_heap, shoe, resting_shape, papers, leaf_sheet)


def scatter(rng: Rng, low, high, z: float, count: float, things=SMALL) -> list[Patch]:
    """About `count` things standing on a rectangle, kept apart where that is easy, turned at random.

    Args:
        low, high: (2,) corners of the rectangle, metres.
    """
    patches: list[Patch] = []
    taken: list[tuple[np.ndarray, float]] = []
    low, high = np.asarray(low, float), np.asarray(high, float)
    room = float((high - low).min())
    for _ in range(int(rng.poisson(count))):
        thing = things[rng.integers(len(things))](rng)
        points = np.concatenate([patch.grid.reshape(-1, 3) for patch in thing])
        reach = float(np.abs(points[:, :2]).max())
        if reach > 0.6 * room:
            continue
        for _ in range(4):
            margin = np.minimum(reach, (high - low) / 2)
            spot = rng.uniform(low + margin, high - margin + 1e-6)
            if all(np.hypot(*(spot - other)) > reach + size for other, size in taken):
                taken.append((spot, reach))
                patches += moved(thing, (*spot, z), rng.uniform(-np.pi, np.pi))
                break
    return patches
