"""Tables and desks, centred on the origin; TV boards and desks for the wall stand at y = 0."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.clutter import scatter
from room2dgs.tools.random_rooms.seats import four_legs
from room2dgs.tools.random_rooms.shapes import bar, block, lathe, moved, prism, rotation, rounded_box
from room2dgs.tools.random_rooms.style import Style, carcass

Rng = np.random.Generator


def table_top(rng: Rng, width: float, depth: float, thick: float, material: Material) -> list[Patch]:
    """A board on z = 0: rectangle, disc, ellipse, cut corners, or round corners."""
    kind = rng.random()
    if kind < 0.6:
        return block(width, depth, thick, material, "table")
    if kind < 0.75:
        edge = min(0.01, thick / 3)
        disc = [(0, 0), (1 - edge, 0), (1, edge), (1, thick - edge), (1 - edge, thick), (0, thick)]
        patch = lathe(disc, material, "table", 32)
        scaled = patch.grid * (width / 2, depth / 2, 1.0)
        return [Patch(scaled, (np.pi * width, depth / 2 + thick), material, "table")]
    cut = min(width, depth) * rng.uniform(0.1, 0.3)
    x, y = width / 2, depth / 2
    outline = [(x, y - cut), (x - cut, y), (cut - x, y), (-x, y - cut), (-x, cut - y), (cut - x, -y), (x - cut, -y)]
    return prism([*outline, (x, cut - y)], thick, material, "table")


def table(rng: Rng, style: Style) -> list[Patch]:
    """A dining, side or coffee table with what lies on it."""
    kind = rng.random()
    if kind < 0.5:
        width, depth, height = rng.uniform(0.9, 2.0), rng.uniform(0.7, 1.0), rng.uniform(0.7, 0.78)
    elif kind < 0.8:
        width, depth, height = rng.uniform(0.6, 1.3), rng.uniform(0.45, 0.8), rng.uniform(0.3, 0.5)
    else:
        width = rng.uniform(0.35, 0.6)
        depth, height = width * rng.uniform(0.8, 1.1), rng.uniform(0.4, 1.05)
    wood, thick = carcass(rng, style), rng.uniform(0.015, 0.05)
    top = materials.stone(rng) if rng.random() < 0.15 else (materials.glass_like(rng) if rng.random() < 0.1 else wood)
    patches = moved(table_top(rng, width, depth, thick, top), (0, 0, height - thick))
    under = height - thick
    support = rng.random()
    if support < 0.6:
        patches += four_legs(rng, width / 2 - 0.1, depth / 2 - 0.1, under, wood, rng.uniform(0.03, 0.08))
        if rng.random() < 0.5:
            for y in (-depth / 2 + 0.1, depth / 2 - 0.1):
                patches += box(
                    (0.1 - width / 2, y - 0.01, under - 0.08), (width / 2 - 0.1, y + 0.01, under), wood, "table"
                )
    elif support < 0.8:
        foot = 0.3 * min(width, depth)
        pole = [(0, 0), (foot, 0), (foot, 0.02), (0.05, 0.05), (0.04, under), (0, under)]
        patches.append(lathe(pole, style.metal if rng.random() < 0.5 else wood, "table"))
    elif support < 0.92:
        for x in (-0.36 * width, 0.36 * width):
            patches += box((x - 0.02, -0.4 * depth, 0), (x + 0.02, 0.4 * depth, under), wood, "table")
    else:
        for x in (-0.35 * width, 0.35 * width):
            patches += bar((x, -0.35 * depth, 0), (x, 0.35 * depth, under), 0.05, wood, "table")
            patches += bar((x, 0.35 * depth, 0), (x, -0.35 * depth, under), 0.05, wood, "table")
    if rng.random() < 0.15:
        patches += moved(tablecloth(rng, width, depth), (0, 0, height))
    half = np.array([0.38 * width, 0.36 * depth])
    return patches + scatter(rng, -half, half, height + 0.003, style.mess * 9 * width * depth + 1)


def tablecloth(rng: Rng, width: float, depth: float) -> list[Patch]:
    """A cloth with hanging wavy edges over a rectangle, its top at z = 3 mm."""
    over, n = rng.uniform(0.08, 0.3), 40
    x, y = width / 2 + 0.005, depth / 2 + 0.005
    corner = np.array([(x, -y), (x, y), (-x, y), (-x, -y), (x, -y)])
    lengths = np.linalg.norm(np.diff(corner, axis=0), axis=1)
    s = np.linspace(0, lengths.sum(), 2 * n + 1)
    marks = np.concatenate([[0], np.cumsum(lengths)])
    ring = np.column_stack([np.interp(s, marks, corner[:, k]) for k in (0, 1)])
    ring[-1] = ring[0]
    wave = 1 + 0.03 * (1 + np.sin(s * rng.uniform(12, 25)))[:, None]
    wave[-1] = wave[0]
    zero = np.zeros((len(ring), 1))
    rows = [np.hstack([ring * wave, zero - over]), np.hstack([ring, zero + 0.003]), np.hstack([0 * ring, zero + 0.003])]
    return [Patch(np.stack(rows), (float(lengths.sum()), over + depth / 2), materials.cloth(rng), "tablecloth")]


def monitor(rng: Rng) -> list[Patch]:
    """A screen on a foot, facing +y."""
    width = rng.uniform(0.4, 0.75)
    height = width * rng.uniform(0.55, 0.65)
    dark = materials.plastic(rng)
    panel = block(width, 0.03, height, dark, "monitor")
    panel += moved(block(width - 0.03, 0.002, height - 0.03, materials.screen(rng), "screen"), (0, 0.016, 0.015))
    patches = moved(panel, (0, 0, rng.uniform(0.08, 0.16)), rotation(0, 0, rng.normal(0.05, 0.06)))
    patches += moved(block(0.05, 0.03, 0.3, dark, "monitor"), (0, -0.03, 0))
    return patches + block(0.25, 0.18, 0.012, dark, "monitor")


def laptop(rng: Rng) -> list[Patch]:
    """An open laptop facing +y."""
    shell = materials.metal(rng) if rng.random() < 0.5 else materials.plastic(rng)
    patches = block(0.33, 0.23, 0.016, shell, "laptop", top=materials.screen(rng) if rng.random() < 0.3 else shell)
    lid = block(0.33, 0.008, 0.22, shell, "laptop", front=materials.screen(rng))
    return patches + moved(lid, (0, -0.115, 0.012), rotation(0, 0, rng.uniform(0.1, 0.6)))


def keyboard(rng: Rng) -> list[Patch]:
    """A keyboard with rows of keys, and a mouse."""
    body, keys = materials.plastic(rng), materials.plastic(rng)
    patches = block(0.44, 0.14, 0.015, body, "keyboard")
    for row in np.linspace(-0.05, 0.05, 5):
        patches += moved(block(0.42, 0.017, 0.008, keys, "keyboard"), (0, row, 0.015))
    return patches + moved([rounded_box((0.03, 0.05, 0.017), 0.015, body, "mouse")], (0.3, 0, 0.017))


def desk(rng: Rng, style: Style) -> list[Patch]:
    """A desk at the wall with screens, keyboard, drawers and paper; the sitter comes from +y."""
    width, depth, height = rng.uniform(1.0, 1.9), rng.uniform(0.55, 0.85), rng.uniform(0.7, 0.78)
    wood = carcass(rng, style)
    patches = box((-width / 2, 0.01, height - 0.03), (width / 2, depth, height), wood, "desk")
    frame = style.metal if rng.random() < 0.5 else wood
    patches += moved(four_legs(rng, width / 2 - 0.06, depth / 2 - 0.06, height - 0.03, frame, 0.045), (0, depth / 2, 0))
    if rng.random() < 0.5:
        x = rng.choice([-1, 1]) * (width / 2 - 0.26)
        drawers = block(0.4, depth - 0.1, height - 0.1, carcass(rng, style), "desk")
        patches += moved(drawers, (x, depth / 2, 0.04))
        for z in np.linspace(0.06, height - 0.22, 3):
            patches += moved(block(0.38, 0.015, 0.17, style.front, "desk"), (x, depth - 0.045, z))
    screens = int(rng.integers(0, 4))
    for k in range(screens):
        spot = ((k - (screens - 1) / 2) * 0.6 + rng.normal(0, 0.04), rng.uniform(0.16, 0.25), height)
        patches += moved(monitor(rng), spot, rng.normal(0, 0.15) + 0.3 * ((screens - 1) / 2 - k))
    if screens:
        patches += moved(keyboard(rng), (rng.uniform(-0.2, 0.2), 0.7 * depth, height), rng.normal(0, 0.1))
    elif rng.random() < 0.6:
        patches += moved(laptop(rng), (rng.uniform(-0.2, 0.2), 0.6 * depth, height), rng.normal(0, 0.3))
    things = scatter(rng, (-0.45 * width, 0.08), (0.45 * width, depth - 0.08), height, 1 + 7 * style.mess)
    return patches + things


def tv_board(rng: Rng, style: Style) -> list[Patch]:
    """A low board at the wall with a television standing on or hanging above it."""
    width, depth, height = rng.uniform(1.0, 2.2), rng.uniform(0.35, 0.5), rng.uniform(0.3, 0.6)
    wood, foot = carcass(rng, style), rng.choice([0.0, 0.08, 0.15])
    patches = box((-width / 2, 0.01, foot), (width / 2, depth, height), wood, "tv board")
    for left, right in pairwise(np.linspace(-width / 2, width / 2, int(rng.integers(2, 5)))):
        patches += box(
            (left + 0.01, depth, foot + 0.02), (right - 0.01, depth + 0.015, height - 0.02), style.front, "tv board"
        )
    if foot:
        patches += moved(four_legs(rng, width / 2 - 0.1, depth / 2 - 0.08, foot, wood, 0.04), (0, depth / 2, 0))
    wide = rng.uniform(0.7, min(1.5, width))
    tall = 0.57 * wide
    hung = rng.random() < 0.4
    low, y = height + (rng.uniform(0.2, 0.45) if hung else 0.06), 0.03 if hung else 0.6 * depth
    television = block(wide, 0.04, tall, materials.plastic(rng), "tv")
    television += moved(block(wide - 0.03, 0.003, tall - 0.03, materials.screen(rng), "screen"), (0, 0.021, 0.015))
    patches += moved(television, (0, y, low), 0.0 if hung else rng.normal(0, 0.1))
    if not hung:
        patches += moved(block(0.4 * wide, 0.2, 0.06, materials.plastic(rng), "tv"), (0, y, height))
    for low_x, high_x in ((-0.48 * width, -wide / 2), (wide / 2, 0.48 * width)):
        if high_x - low_x > 0.15:
            patches += scatter(rng, (low_x, 0.05), (high_x, depth - 0.05), height, 1 + 2 * style.mess)
    return patches
