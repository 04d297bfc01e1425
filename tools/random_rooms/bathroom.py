"""Tubs, toilets, washbasins, showers and towels, standing at the wall y = 0."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box, curtain
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.clutter import bottle, scatter
from room2dgs.tools.random_rooms.shapes import block, lathe, moved, rod, rotation, rounded_box, tube, two_sided
from room2dgs.tools.random_rooms.style import Style, carcass

Rng = np.random.Generator


def vessel(half_x: float, half_y: float, profile, square: float, material: Material, tag: str) -> Patch:
    """A bowl over a superellipse about z.

    Args:
        profile: (N, 2) share of the half axes and height, from the foot over the rim to the inner bottom.
        square: exponent from 2 (ellipse) to 8 (nearly a rectangle).
    """
    profile = np.asarray(profile, float)
    angle = np.linspace(0, 2 * np.pi, 41)
    cos, sin = np.cos(angle), np.sin(angle)
    scale = (np.abs(cos) ** square + np.abs(sin) ** square) ** (-1 / square)
    ring = np.column_stack([half_x * scale * cos, half_y * scale * sin])
    ring[-1] = ring[0]
    grid = np.concatenate(
        [profile[:, :1, None] * ring[None], np.broadcast_to(profile[:, 1:, None], (len(profile), len(ring), 1))], axis=2
    )
    return Patch(grid, (4 * (half_x + half_y), 2 * profile[:, 1].max() + half_x), material, tag)


def bathtub(rng: Rng, style: Style) -> list[Patch]:
    """A tub along the wall: set into a box, or free with round sides."""
    width, depth, height = rng.uniform(1.4, 1.8), rng.uniform(0.65, 0.85), rng.uniform(0.5, 0.65)
    white = materials.ceramic(rng)
    inner = [(0.92, height), (0.86, 0.5 * height), (0.76, 0.25 * height), (0.6, 0.18 * height), (0, 0.16 * height)]
    if rng.random() < 0.5:
        rows = [
            (0, 0),
            (0.7, 0),
            (0.85, 0.15 * height),
            (0.93, 0.5 * height),
            (1, height - 0.01),
            (0.99, height + 0.005),
        ]
        patches = moved([vessel(width / 2, depth / 2, [*rows, *inner], 3.0, white, "tub")], (0, depth / 2 + 0.05, 0))
    else:
        side = materials.tile(rng) if rng.random() < 0.6 else white
        tub = vessel(
            width / 2 - 0.01, depth / 2 - 0.01, [(1.0, height - 0.02), (1.0, height), *inner], 6.0, white, "tub"
        )
        patches = moved([tub], (0, depth / 2, 0))
        h, t = width / 2, 0.06
        patches += box((-h, depth - t, 0), (h, depth, height - 0.01), side, "tub side")
        for x in (-h, h - t):
            patches += box((x, 0.0, 0), (x + t, depth - t, height - 0.01), side, "tub side")
        patches += box((-h, 0.0, 0), (h, t, height - 0.01), side, "tub side")
    tap = [(0, 0, 0), (0, 0.06, 0), (0, 0.12, -0.02), (0, 0.15, -0.05)]
    patches += moved([tube(tap, 0.015, style.metal, "tap")], (rng.uniform(-0.3, 0.3) * width, 0.02, height + 0.15))
    if rng.random() < 0.3:
        patches += shower_curtain(rng, width, depth)
    return patches


def shower_curtain(rng: Rng, width: float, depth: float) -> list[Patch]:
    """A curtain along the tub's edge, drawn to one side."""
    span = width * rng.uniform(0.25, 0.8)
    left = rng.choice([-width / 2, width / 2 - span])
    sheet = curtain(span, 1.6, 0.02, 9 * span, materials.cloth(rng), "curtain")
    rail = rod((-width / 2, depth, 1.95), (width / 2, depth, 1.95), 0.012, materials.metal(rng), "rail")
    return [rail, *moved(two_sided(sheet, 0.004), (left, depth, 0.33))]


def toilet(rng: Rng, style: Style) -> list[Patch]:
    """A toilet with a cistern or hung on the wall; lid up or down."""
    white = materials.ceramic(rng)
    rows = [(0, 0), (0.55, 0), (0.6, 0.15), (0.95, 0.34), (1, 0.4)]
    if rng.random() < 0.3:
        rows = [(0, 0.12), (0.5, 0.12), (0.8, 0.2), (1, 0.34), (1, 0.4)]
    inner = [(0.8, 0.4), (0.7, 0.3), (0.4, 0.22), (0, 0.2)]
    patches = moved([vessel(0.18, 0.26, [*rows, *inner], 2.3, white, "toilet")], (0, 0.45, 0))
    lid = [vessel(0.185, 0.235, [(0, 0), (1, 0), (1, 0.02), (0.95, 0.03), (0, 0.032)], 2.3, white, "lid")]
    if rng.random() < 0.6:
        patches += moved(lid, (0, 0.46, 0.405))
    else:
        patches += moved(lid, (0, 0.2, 0.65), rotation(0, 0, 1.45))
    if rng.random() < 0.7:
        tank = rounded_box((0.19, 0.085, 0.17), 0.03, white, "cistern")
        patches += moved([tank], (0, 0.1, 0.6))
    patches += box((-0.1, 0.02, 0), (0.1, 0.3, 0.36), white, "toilet")
    return patches


def washbasin(rng: Rng, style: Style) -> list[Patch]:
    """A basin on a pedestal, a cabinet or a board, with a tap and a mirror above."""
    width, depth, height = rng.uniform(0.4, 0.75), rng.uniform(0.38, 0.5), rng.uniform(0.82, 0.9)
    white, square = materials.ceramic(rng), rng.choice([2.0, 3.0, 6.0])
    rows = [(0, 0), (0.6, 0), (0.85, 0.06), (1, 0.15), (1, 0.17), (0.9, 0.17), (0.82, 0.11), (0.6, 0.06), (0, 0.05)]
    bowl = vessel(width / 2, depth / 2, rows, square, white, "basin")
    patches = moved([bowl], (0, depth / 2 + 0.03, height - 0.17))
    kind = rng.random()
    if kind < 0.35:
        pedestal = lathe([(0.12, 0), (0.08, 0.1), (0.07, height - 0.16)], white, "pedestal")
        patches += moved([pedestal], (0, depth / 2, 0))
    elif kind < 0.75:
        low, wide = rng.uniform(0.05, 0.4), width / 2 + rng.uniform(0, 0.4)
        patches += box((-wide, 0.005, low), (wide, depth, height - 0.16), carcass(rng, style), "vanity")
        patches += scatter(
            rng, (width / 2, 0.05), (max(wide, width / 2 + 0.05), depth), height - 0.16, 2 * style.mess, (bottle,)
        )
    tap = [(0, 0, 0), (0, 0, 0.1), (0, 0.05, 0.15), (0, 0.11, 0.13)]
    patches += moved([tube(tap, 0.012, style.metal, "tap")], (0, 0.06, height - 0.03))
    if rng.random() < 0.7:
        wide, tall = rng.uniform(0.35, 0.9), rng.uniform(0.5, 0.9)
        deep = rng.choice([0.01, 0.02, 0.15])
        patches += box((-wide / 2, 0.003, 1.2), (wide / 2, deep, 1.2 + tall), materials.glass_like(rng), "mirror")
    return patches


def shower(rng: Rng, style: Style) -> list[Patch]:
    """A shower tray with tiled sides, a pipe and a curtain."""
    size, tile = rng.uniform(0.75, 1.0), materials.tile(rng)
    patches = moved(block(size, size, rng.uniform(0.03, 0.15), materials.ceramic(rng), "tray"), (0, size / 2, 0))
    patches += box((-size / 2, 0, 0.1), (size / 2, 0.008, 2.1), tile, "tiles")
    patches += box((-size / 2 - 0.04, 0, 0), (-size / 2, size, 2.1), tile, "tiles")
    pipe = [(0, 0.05, 1.0), (0, 0.05, 2.0), (0, 0.12, 2.08), (0, 0.3, 2.06), (0, 0.34, 2.0)]
    patches.append(tube(pipe, 0.01, style.metal, "pipe"))
    patches += moved([lathe([(0, 0), (0.08, 0), (0.02, 0.03), (0, 0.03)], style.metal, "head")], (0, 0.34, 1.97))
    if rng.random() < 0.6:
        patches += shower_curtain(rng, size, size)
    return patches


def washer(rng: Rng, style: Style) -> list[Patch]:
    """A washing machine or dryer, with a round door."""
    shell = materials.plastic(rng)
    patches = box((-0.3, 0.02, 0), (0.3, 0.58, 0.85), shell, "washer")
    ring = [(0, 0), (0.2, 0), (0.19, 0.035), (0.15, 0.05), (0.12, 0.02), (0, 0.03)]
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    patches += moved([lathe(ring, materials.glass_like(rng), "door")], (0, 0.58, 0.42), turn)
    patches += box((-0.29, 0.58, 0.74), (0.29, 0.59, 0.84), materials.plastic(rng), "panel")
    return patches + scatter(rng, (-0.28, 0.05), (0.28, 0.55), 0.85, 3 * style.mess)


def towels(rng: Rng, style: Style) -> list[Patch]:
    """Towels over a rail at the wall; z = 0 is the floor."""
    width, z = rng.uniform(0.4, 0.8), rng.uniform(1.0, 1.5)
    patches = [rod((-width / 2, 0.07, z), (width / 2, 0.07, z), 0.01, style.metal, "rail")]
    for x in np.linspace(-width / 2, width / 2, int(rng.integers(1, 3)) + 2)[1:-1]:
        wide, drop, cloth = rng.uniform(0.18, 0.4), rng.uniform(0.3, 0.7), materials.cloth(rng)
        sheet = curtain(wide, drop, 0.006, 3, cloth, "towel")
        patches += moved(two_sided(sheet, 0.025), (x - wide / 2, 0.09, z - drop + 0.012))
        patches += moved(block(wide, 0.03, 0.012, cloth, "towel"), (x, 0.078, z + 0.004))
    return patches
