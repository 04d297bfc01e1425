"""Shelves, wardrobes, cupboards and drawers, standing at the wall y = 0."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.clutter import LARGE, SMALL, scatter
from room2dgs.tools.random_rooms.seats import four_legs
from room2dgs.tools.random_rooms.shapes import moved, rod
from room2dgs.tools.random_rooms.style import Style, carcass

Rng = np.random.Generator


def handle(at, length: float, upright: bool, material: Material) -> list[Patch]:
    """A knob, a bar or nothing much on a front that faces +y at the point `at`."""
    x, y, z = at
    half = (0.006, 0.012, length / 2) if upright else (length / 2, 0.012, 0.006)
    return box((x - half[0], y, z - half[2]), (x + half[0], y + 2 * half[1], z + half[2]), material, "handle")


def fronts(rng: Rng, style: Style, low, high, y: float, material: Material, columns: int, rows: int) -> list[Patch]:
    """Doors or drawer fronts with handles over the rectangle from low to high (x, z), facing +y at y."""
    patches = []
    xs, zs = np.linspace(low[0], high[0], columns + 1), np.linspace(low[1], high[1], rows + 1)
    gap, thick = 0.004, rng.uniform(0.012, 0.024)
    grip, framed = rng.integers(4), rng.random() < 0.25
    for column in range(columns):
        for row in range(rows):
            a, b = (xs[column] + gap, zs[row] + gap), (xs[column + 1] - gap, zs[row + 1] - gap)
            patches += box((a[0], y, a[1]), (b[0], y + thick, b[1]), material, "front")[1:]
            if framed and min(b[0] - a[0], b[1] - a[1]) > 0.25:
                inset = 0.06
                low_, high_ = (a[0] + inset, y + thick, a[1] + inset), (b[0] - inset, y + thick + 0.01, b[1] - inset)
                patches += box(low_, high_, material, "front")
            tall = b[1] - a[1] > b[0] - a[0]
            if grip == 0:
                continue
            side = b[0] - 0.05 if column % 2 == 0 else a[0] + 0.05
            spot = (side, y + thick, (a[1] + b[1]) / 2) if tall else ((a[0] + b[0]) / 2, y + thick, b[1] - 0.05)
            if grip == 1:
                start = np.array(spot)
                patches.append(rod(start, start + np.array([0, 0.022, 0]), 0.014, style.metal, "knob"))
            else:
                patches += handle(spot, min(0.16, 0.6 * (b[0] - a[0])), tall, style.metal)
    return patches


def shelf_content(rng: Rng, width: float, depth: float, room: float, fullness: float) -> list[Patch]:
    """What stands on one board (y from 0 to `depth`): books, boxes, vessels, gaps."""
    patches: list[Patch] = []
    x = -width / 2 + 0.01
    kind = rng.random()
    if kind > fullness + 0.15:
        return patches
    if kind < 0.25:
        found = scatter(rng, (-width / 2, 0.02), (width / 2, depth), 0.0, 2 + 5 * width, SMALL)
        return [patch for patch in found if patch.grid[..., 2].max() < room - 0.01]
    while x < width / 2 - 0.06:
        what = rng.random()
        if what < 0.6:
            height, deep, run = rng.uniform(0.5, 0.92) * room, rng.uniform(0.6, 0.95) * depth, rng.integers(2, 9)
            lean = 0.0 if rng.random() < 0.8 else rng.uniform(0.05, 0.3)
            for _ in range(int(run)):
                thick = rng.uniform(0.012, 0.055)
                if x + thick > width / 2 - 0.01:
                    break
                tall = height * rng.uniform(0.85, 1.08)
                book = box((0, 0, 0), (thick, deep, min(tall, 0.96 * room)), materials.book(rng), "book")
                book = [*book[:2], *book[3:4], book[5]]  # back and bottom are never seen
                patches += moved(book, (x, 0.0, 0.0)) if not lean else moved(book, (x, 0, 0), leaning(lean))
                x += thick + 0.001
            x += lean * height
        elif what < 0.8:
            wide = min(rng.uniform(0.1, 0.35), width / 2 - x)
            deep, high = rng.uniform(0.6, 0.98) * depth, rng.uniform(0.3, 0.9) * room
            case = materials.cardboard(rng) if rng.random() < 0.5 else materials.anything(rng)
            patches += box((x, 0, 0), (x + wide, deep, high), case, "case")
            x += wide + 0.01
        else:
            x += rng.uniform(0.05, 0.3)
    return patches


def leaning(angle: float) -> np.ndarray:
    """(3, 3) rotation that leans a book to +x."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])


def shelf(rng: Rng, style: Style) -> list[Patch]:
    """An open shelf of one to three bays, with or without a back."""
    width, height, depth = rng.uniform(0.5, 2.0), rng.choice([0.8, 1.2, 1.8, 2.0, 2.2]), rng.uniform(0.22, 0.42)
    board, wood = rng.uniform(0.015, 0.04), carcass(rng, style)
    bays = max(1, round(width / rng.uniform(0.45, 1.0)))
    patches: list[Patch] = []
    if rng.random() < 0.7:
        patches += box((-width / 2, 0.002, 0.02), (width / 2, 0.012, height), wood, "shelf")
    edges = np.linspace(-width / 2, width / 2 - board, bays + 1)
    for x in edges:
        patches += box((x, 0.005, 0), (x + board, depth, height), wood, "shelf")
    levels = np.linspace(rng.uniform(0.02, 0.1), height - board, max(2, round(height / rng.uniform(0.25, 0.45)) + 1))
    fullness = rng.beta(2, 1.3)
    for z in levels:
        patches += box((-width / 2 + board, 0.005, z), (width / 2, depth - 0.004, z + board), wood, "shelf")
    for z, above in pairwise(levels):
        for left, right in pairwise(edges):
            inner, room = right - left - board, above - z - board
            content = shelf_content(rng, inner, depth - 0.03, room, fullness)
            patches += moved(content, ((left + right + board) / 2, 0.015, z + board))
    return patches + scatter(rng, (-width / 2, 0.02), (width / 2, depth), height, 2 * style.mess, LARGE)


def wall_board(rng: Rng, style: Style) -> list[Patch]:
    """Boards fixed to the wall with things on them; the lowest at z = 0."""
    width, depth = rng.uniform(0.4, 1.6), rng.uniform(0.15, 0.3)
    patches = []
    for k in range(int(rng.integers(1, 4))):
        z, shift = 0.35 * k, rng.uniform(-0.2, 0.2) * (k > 0)
        board = box((-width / 2, 0, 0), (width / 2, depth, 0.025), style.wood, "board")
        board += moved(shelf_content(rng, width - 0.02, depth - 0.02, 0.32, 0.8), (0, 0.01, 0.025))
        patches += moved(board, (shift, 0, z))
    return patches


def cupboard(rng: Rng, style: Style) -> list[Patch]:
    """A closed piece: wardrobe, cupboard, chest of drawers, sideboard, locker."""
    kind = rng.random()
    if kind < 0.35:
        width, height, depth = rng.uniform(0.5, 2.4), rng.uniform(1.8, 2.35), rng.uniform(0.4, 0.65)
        columns, rows = max(1, round(width / rng.uniform(0.4, 0.7))), int(rng.choice([1, 1, 1, 2]))
    elif kind < 0.7:
        width, height, depth = rng.uniform(0.4, 1.5), rng.uniform(0.6, 1.2), rng.uniform(0.35, 0.5)
        columns, rows = int(rng.choice([1, 1, 2, 3])), int(rng.integers(1, 6))
    else:
        width, height, depth = rng.uniform(1.0, 2.2), rng.uniform(0.55, 0.95), rng.uniform(0.35, 0.5)
        columns, rows = int(rng.integers(2, 5)), int(rng.integers(1, 4))
    body, foot = carcass(rng, style), rng.choice([0.0, 0.0, 0.06, 0.15])
    patches = box((-width / 2, 0.005, foot), (width / 2, depth, height), body, "cupboard")
    front = body if rng.random() < 0.5 else style.front
    front = materials.glass_like(rng) if rng.random() < 0.06 else front
    patches += fronts(rng, style, (-width / 2, foot + 0.02), (width / 2, height - 0.01), depth, front, columns, rows)
    if foot:
        patches += moved(four_legs(rng, width / 2 - 0.06, depth / 2 - 0.06, foot, style.wood, 0.05), (0, depth / 2, 0))
    things = LARGE if height > 1.5 else SMALL
    count = (1 + 6 * style.mess) * width * (0.4 if height > 1.5 else 1.0)
    return patches + scatter(rng, (-0.46 * width, 0.05), (0.46 * width, depth - 0.05), height, count, things)


def fridge(rng: Rng, style: Style) -> list[Patch]:
    """A refrigerator of one or two doors."""
    width, height, depth = rng.uniform(0.5, 0.9), rng.choice([0.85, 1.6, 1.85, 2.0]), rng.uniform(0.55, 0.7)
    shell = materials.metal(rng) if rng.random() < 0.4 else materials.plastic(rng)
    patches = box((-width / 2, 0.02, 0.03), (width / 2, depth, height), shell, "fridge")
    patches += fronts(rng, style, (-width / 2, 0.06), (width / 2, height), depth, shell, 1, 1 if height < 1 else 2)
    return patches + scatter(rng, (-0.4 * width, 0.1), (0.4 * width, depth - 0.1), height, 2 * style.mess, LARGE)
