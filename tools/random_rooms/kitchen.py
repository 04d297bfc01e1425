"""Kitchen runs at the wall y = 0, islands about the origin, and their modules."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.clutter import open_box, scatter
from room2dgs.tools.random_rooms.shapes import block, lathe, moved, rod, tube
from room2dgs.tools.random_rooms.storage import fronts
from room2dgs.tools.random_rooms.style import Style, carcass

Rng = np.random.Generator
TOP = 0.04  # metres, a counter's thickness


def kitchen_run(rng: Rng, style: Style) -> list[Patch]:
    """Base cabinets under one counter with sink, hob and oven; wall cabinets, hood and tiles above; clutter."""
    height, depth = rng.uniform(0.84, 0.95), rng.uniform(0.55, 0.66)
    count = int(rng.integers(2, 7))
    widths = rng.choice([0.4, 0.45, 0.5, 0.6, 0.6, 0.8, 0.9], count)
    edges = np.concatenate([[0.0], np.cumsum(widths)]) - widths.sum() / 2
    front, body = carcass(rng, style), carcass(rng, style)
    counter: Material = materials.stone(rng)
    if rng.random() < 0.3:
        counter = style.wood
    sink = int(rng.integers(count)) if rng.random() < 0.75 else -1
    hob = int(rng.integers(count)) if rng.random() < 0.7 else -1
    patches: list[Patch] = []
    for k, (left, right) in enumerate(pairwise(edges)):
        base = base_module(rng, style, right - left, height - TOP, depth, front, body, "sink" if k == sink else "")
        if k == hob and rng.random() < 0.8:
            base = oven(rng, style, right - left, height - TOP, depth, body)
        patches += moved(base, ((left + right) / 2, 0, 0))
        top = sink_top(rng, style, right - left, depth + 0.02, counter) if k == sink else None
        top = top or box(
            (left - (left + right) / 2, 0.0, 0), (right - (left + right) / 2, depth + 0.02, TOP), counter, "counter"
        )
        patches += moved(top, ((left + right) / 2, 0, height - TOP))
        if k == hob and k != sink:
            patches += moved(hob_top(rng, style), ((left + right) / 2, depth / 2 + 0.01, height))
        elif k != sink:
            patches += scatter(rng, (left + 0.02, 0.05), (right - 0.02, depth - 0.03), height, 0.5 + 4 * style.mess)
    if rng.random() < 0.6:
        tiles = materials.tile(rng)
        patches += box((edges[0], 0.0, height), (edges[-1], 0.006, height + rng.uniform(0.1, 0.65)), tiles, "tiles")
    if rng.random() < 0.75:
        patches += wall_cabinets(rng, style, edges, height + rng.uniform(0.45, 0.65), front, body, hob)
    if rng.random() < 0.4:
        width = rng.uniform(0.5, 0.7)
        side = rng.choice([-1, 1]) * (widths.sum() / 2 + width / 2 + 0.005)
        tall = rng.uniform(1.9, 2.2)
        tower = box((-width / 2, 0.005, 0.08), (width / 2, depth, tall), body, "tower")
        tower += fronts(rng, style, (-width / 2, 0.1), (width / 2, tall), depth, front, 1, int(rng.integers(1, 4)))
        patches += moved(tower, (side, 0, 0))
        patches = moved(patches, (-side / 4, 0, 0))
    return patches


def base_module(
    rng: Rng, style: Style, width: float, height: float, depth: float, front: Material, body: Material, kind: str
) -> list[Patch]:
    """One cabinet under the counter, x centred; lower inside below a sink."""
    top = height - 0.2 if kind == "sink" else height
    patches = box((-width / 2, 0.005, 0.1), (width / 2, depth - 0.02, top), body, "cabinet")
    if kind == "sink":
        for x in (-width / 2, width / 2 - 0.016):
            patches += box((x, 0.005, top), (x + 0.016, depth - 0.02, height), body, "cabinet")
    patches += box((-width / 2, 0.02, 0.0), (width / 2, depth - 0.08, 0.1), style.plain, "plinth")
    if rng.random() < 0.08 and kind != "sink":
        return patches
    rows = int(rng.choice([1, 1, 3, 4])) if kind != "sink" else 1
    columns = 2 if width > 0.65 and rows == 1 else 1
    return patches + fronts(
        rng, style, (-width / 2, 0.1), (width / 2, height - 0.004), depth - 0.02, front, columns, rows
    )


def sink_top(rng: Rng, style: Style, width: float, depth: float, counter: Material) -> list[Patch]:
    """A piece of counter with a hole, a basin in it and a tap; x centred, z from 0 to `TOP`."""
    steel = materials.metal(rng) if rng.random() < 0.7 else materials.ceramic(rng)
    half, low, high = width / 2 - 0.05, 0.12, depth - 0.08
    deep = rng.uniform(0.12, 0.18)
    patches = box((-width / 2, 0, 0), (-half, depth, TOP), counter, "counter")
    patches += box((half, 0, 0), (width / 2, depth, TOP), counter, "counter")
    patches += box((-half, 0, 0), (half, low, TOP), counter, "counter")
    patches += box((-half, high, 0), (half, depth, TOP), counter, "counter")
    basin = open_box(2 * half, high - low, deep + TOP + 0.003, 0.006, steel, "sink")
    patches += moved(basin, (0, (low + high) / 2, -deep))
    t = np.linspace(0, np.pi, 8)
    rise, reach = rng.uniform(0.12, 0.3), rng.uniform(0.07, 0.11)
    arc = np.column_stack([0 * t, reach - reach * np.cos(t), rise + reach * np.sin(t)])
    tap = np.concatenate([[[0, 0, 0], [0, 0, 0.5 * rise]], arc])
    patches += moved([tube(tap, 0.012, style.metal, "tap")], (0, 0.06, TOP))
    return patches + moved([rod((0, 0, 0), (0.06, 0, 0.02), 0.008, style.metal, "tap")], (0.01, 0.06, TOP + 0.03))


def hob_top(rng: Rng, style: Style) -> list[Patch]:
    """A cooking plate about the origin, with pots at times."""
    patches = block(0.56, 0.48, 0.008, materials.glass_like(rng) if rng.random() < 0.6 else style.metal, "hob")
    gas = rng.random() < 0.4
    for x in (-0.14, 0.14):
        for y in (-0.12, 0.12):
            radius = rng.uniform(0.06, 0.1)
            if gas:
                for angle in (0.0, np.pi / 2):
                    patches += moved(block(0.2, 0.01, 0.012, style.metal, "hob"), (x, y, 0.025), angle)
            patches.append(lathe([(radius, 0.008), (radius, 0.012), (0, 0.012)], materials.metal(rng), "hob"))
            patches[-1] = moved([patches[-1]], (x, y, 0))[0]
            if rng.random() < 0.3:
                patches += moved(pot(rng), (x, y, 0.038 if gas else 0.013), rng.uniform(-3, 3))
    return patches


def pot(rng: Rng) -> list[Patch]:
    """A pot, pan or kettle, with or without a lid."""
    radius, height, wall = rng.uniform(0.08, 0.14), rng.uniform(0.04, 0.2), 0.004
    material = materials.metal(rng) if rng.random() < 0.7 else materials.ceramic(rng)
    rim = [(radius - wall, height), (radius - wall, wall), (0, wall)]
    if rng.random() < 0.5:
        rim = [
            (0.6 * radius, height + 0.015),
            (0.1 * radius, height + 0.02),
            (0.1 * radius, height + 0.045),
            (0, height + 0.045),
        ]
    patches = [lathe([(0, 0), (0.95 * radius, 0), (radius, 0.02), (radius, height), *rim], material, "pot")]
    if height < 0.08:
        return [
            *patches,
            rod((radius, 0, height - 0.01), (radius + 0.18, 0, height + 0.02), 0.011, materials.plastic(rng), "pot"),
        ]
    for side in (-1, 1):
        patches.append(
            rod(
                (side * radius * 0.98, 0, 0.75 * height),
                (side * (radius + 0.04), 0, 0.8 * height),
                0.012,
                material,
                "pot",
            )
        )
    return patches


def oven(rng: Rng, style: Style, width: float, height: float, depth: float, body: Material) -> list[Patch]:
    """An oven under the counter: glass door, handle, knobs."""
    patches = box((-width / 2, 0.005, 0.1), (width / 2, depth - 0.02, height), body, "oven")
    patches += box((-width / 2, 0.02, 0.0), (width / 2, depth - 0.08, 0.1), style.plain, "plinth")
    y = depth - 0.02
    patches += box(
        (-width / 2 + 0.005, y, height - 0.12), (width / 2 - 0.005, y + 0.02, height - 0.005), style.metal, "oven"
    )
    low = height - 0.56
    patches += box(
        (-width / 2 + 0.005, y, low), (width / 2 - 0.005, y + 0.025, height - 0.125), materials.glass_like(rng), "oven"
    )
    patches.append(
        rod(
            (-0.4 * width, y + 0.055, height - 0.17),
            (0.4 * width, y + 0.055, height - 0.17),
            0.009,
            style.metal,
            "oven",
        )
    )
    for x in np.linspace(-0.35 * width, 0.35 * width, int(rng.integers(2, 6))):
        patches.append(rod((x, y + 0.02, height - 0.06), (x, y + 0.045, height - 0.06), 0.018, style.metal, "knob"))
    return patches


def wall_cabinets(rng: Rng, style: Style, edges, low: float, front: Material, body: Material, hob: int) -> list[Patch]:
    """Hanging cabinets with gaps, open boards, and a hood over the hob."""
    tall, depth, patches = rng.uniform(0.35, 0.8), rng.uniform(0.3, 0.38), []
    for k, (left, right) in enumerate(pairwise(edges)):
        width, middle = right - left, (left + right) / 2
        kind = rng.random()
        if k == hob:
            patches += moved(hood(rng, style, width, tall), (middle, 0, low + 0.05))
        elif kind < 0.68:
            cabinet = box((-width / 2, 0.003, 0), (width / 2, depth, tall), body, "wall cabinet")
            cabinet += fronts(rng, style, (-width / 2, 0), (width / 2, tall), depth, front, 2 if width > 0.65 else 1, 1)
            patches += moved(cabinet, (middle, 0, low))
        elif kind < 0.85:
            for z in (0.0, 0.35):
                patches += box((left, 0.0, low + z), (right, 0.25, low + z + 0.025), style.wood, "board")
                patches += scatter(rng, (left, 0.02), (right, 0.24), low + z + 0.026, 1 + 3 * style.mess)
    return patches


def hood(rng: Rng, style: Style, width: float, tall: float) -> list[Patch]:
    """An extractor hood: a slanted or flat foot and a duct."""
    steel = materials.metal(rng) if rng.random() < 0.7 else materials.painted(rng)
    wide, deep, duct = width / 2, rng.uniform(0.42, 0.52), rng.uniform(0.09, 0.15)
    patches = box((-wide, 0.003, 0), (wide, deep, 0.05), steel, "hood")
    if rng.random() < 0.6:
        rise = rng.uniform(0.15, 0.3)
        low = [(-wide, 0.003), (wide, 0.003), (wide, deep), (-wide, deep)]
        high = [(-duct, 0.003), (duct, 0.003), (duct, 0.25), (-duct, 0.25)]
        for k in range(4):
            a, b, c, d = low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]
            grid = np.array([[(*a, 0.05), (*b, 0.05)], [(*d, rise), (*c, rise)]])
            patches.append(Patch(grid, (2 * wide, rise), steel, "hood"))
    return patches + box((-duct, 0.003, 0.05), (duct, 0.25, max(tall, 0.35)), steel, "hood")


def island(rng: Rng, style: Style) -> list[Patch]:
    """A free block of cabinets with a counter, about the origin."""
    width, depth, height = rng.uniform(0.9, 2.0), rng.uniform(0.55, 1.0), rng.uniform(0.85, 1.05)
    body, front = carcass(rng, style), style.front
    patches = block(width, depth, height - TOP, body, "island")
    patches += fronts(
        rng, style, (-width / 2, 0.08), (width / 2, height - TOP), depth / 2, front, int(rng.integers(1, 4)), 1
    )
    over = rng.uniform(0.01, 0.2)
    patches += moved(
        block(width + over, depth + 0.05 + over, TOP, materials.stone(rng), "counter"), (0, 0, height - TOP)
    )
    return patches + scatter(
        rng, (-0.45 * width, -0.4 * depth), (0.45 * width, 0.4 * depth), height, 1 + 6 * style.mess
    )
