"""Pieces of furniture, each a list of patches in the local frame.

x runs along the wall with the piece centred on 0, y = 0 is the wall and +y the room (free-standing pieces are
centred on the origin), z is up, metres.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from room2dgs.demo_room import palette
from room2dgs.demo_room.geometry import (
    EMITTER,
    Material,
    Patch,
    box,
    curtain,
    cylinder,
    parallelogram,
    placed,
    sphere,
)

Rng = np.random.Generator


def leg_box(x: float, y: float, width: float, low: float, high: float, material: Material, tag: str) -> list[Patch]:
    """A standing bar of square section `width` with its axis at (x, y)."""
    half = width / 2
    return box((x - half, y - half, low), (x + half, y + half, high), material, tag)


def table(rng: Rng, width: float, depth: float) -> list[Patch]:
    """A table with thin legs, and things lying on it."""
    wood, height = palette.wood(rng), 0.74
    patches = box((-width / 2, -depth / 2, height - 0.03), (width / 2, depth / 2, height), wood, "table")
    for x in (-width / 2 + 0.05, width / 2 - 0.05):
        for y in (-depth / 2 + 0.05, depth / 2 - 0.05):
            patches += leg_box(x, y, 0.04, 0.0, height - 0.03, wood, "table")
    for y in (-depth / 2 + 0.05, depth / 2 - 0.05):
        low, high = (-width / 2 + 0.07, y - 0.01, height - 0.1), (width / 2 - 0.07, y + 0.01, height - 0.03)
        patches += box(low, high, wood, "table")
    clutter = box((-0.15, -0.11, 0.0), (0.15, 0.11, 0.004), palette.poster(rng), "newspaper")
    patches += placed(clutter, (-0.3 * width, -0.1 * depth, height), rng.uniform(-0.5, 0.5))
    patches += placed(book_pile(rng, 4), (0.28 * width, 0.12 * depth, height), rng.uniform(-0.4, 0.4))
    patches += cylinder((-0.02, 0.22 * depth, height), 0.045, 0.10, palette.speckle(rng), "mug")
    patches += cylinder((0.02 * width, -0.15 * depth, height), 0.06, 0.09, palette.speckle(rng), "bowl", 0.13)
    patches.append(sphere((0.02 * width, -0.15 * depth, height + 0.115), 0.06, palette.enamel(rng), "fruit"))
    return patches


def book_pile(rng: Rng, count: int) -> list[Patch]:
    """Books lying on one another, the lowest on z = 0."""
    patches, z = [], 0.0
    for _ in range(count):
        width, depth, thick = rng.uniform(0.18, 0.26), rng.uniform(0.13, 0.18), rng.uniform(0.02, 0.045)
        cover = palette.book(rng)
        faces = {
            "left": palette.PAGES,
            "right": palette.PAGES,
            "back": palette.PAGES,
            "top": palette.poster(rng),
        }
        book = box((-width / 2, -depth / 2, 0), (width / 2, depth / 2, thick), cover, "book", **faces)
        patches += placed(book, (0, 0, z), rng.uniform(-0.3, 0.3))
        z += thick
    return patches


def chair(rng: Rng, wood: Material, seat: Material) -> list[Patch]:
    """A chair with thin legs and slats, its back at -y, about 0.42 m square and 0.9 m high."""
    half, tag = 0.20, "chair"
    patches = box((-half, -half, 0.43), (half, half, 0.46), seat, tag)
    for x in (-half + 0.02, half - 0.02):
        patches += leg_box(x, half - 0.02, 0.032, 0.0, 0.43, wood, tag)
        patches += leg_box(x, -half + 0.02, 0.032, 0.0, 0.43, wood, tag)
        patches += leg_box(x, -half + 0.02, 0.032, 0.46, 0.90, wood, tag)
    for z in (0.58, 0.83):
        patches += box((-half + 0.036, -half + 0.011, z), (half - 0.036, -half + 0.029, z + 0.05), wood, tag)
    for x in np.linspace(-0.115, 0.115, 4):
        patches += box((x - 0.013, -half + 0.014, 0.63), (x + 0.013, -half + 0.026, 0.83), wood, tag)
    return patches


def sofa(rng: Rng, width: float) -> list[Patch]:
    """A sofa of boxes with cushions."""
    depth, fabric, tag = 0.85, palette.cloth(rng), "sofa"
    patches = box((-width / 2, 0.02, 0.06), (width / 2, depth, 0.26), fabric, tag)
    patches += box((-width / 2, 0.02, 0.26), (width / 2, 0.24, 0.82), fabric, tag)
    for side in (-1, 1):
        x = side * (width / 2 - 0.09)
        patches += box((x - 0.09, 0.24, 0.26), (x + 0.09, depth, 0.60), fabric, tag)
    inner = width / 2 - 0.18
    seats = np.linspace(-inner, inner, 3)
    for left, right in pairwise(seats):
        patches += box((left + 0.004, 0.24, 0.26), (right - 0.004, depth + 0.02, 0.43), fabric, tag)
    for x in (-0.6 * inner, 0.55 * inner):
        pillow = box((-0.2, -0.06, 0.0), (0.2, 0.06, 0.38), palette.cloth(rng), "pillow")
        patches += placed(tilted(pillow, 0.3), (x, 0.42, 0.435), rng.uniform(-0.25, 0.25))
    return patches


def tilted(patches: list[Patch], angle: float) -> list[Patch]:
    """Patches leaning towards -y by `angle` radians about the x axis, the lowest point put at z = 0."""
    cos, sin = np.cos(angle), np.sin(angle)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    turned = [Patch(patch.grid @ rotation.T, patch.size, patch.material, patch.tag) for patch in patches]
    lowest = min(patch.grid[..., 2].min() for patch in turned)
    return placed(turned, (0.0, 0.0, -lowest), 0.0)


def bed(rng: Rng, width: float) -> list[Patch]:
    """A bed standing along the wall: frame, mattress, blanket, pillows."""
    depth, wood, tag = 0.95, palette.wood(rng), "bed"
    patches = box((-width / 2, 0.02, 0.08), (width / 2, depth, 0.30), wood, tag)
    patches += box((-width / 2 - 0.04, 0.02, 0.0), (-width / 2, depth, 0.85), wood, tag)
    patches += box((-width / 2 + 0.02, 0.04, 0.30), (width / 2 - 0.02, depth - 0.02, 0.46), palette.cloth(rng), tag)
    patches += box(
        (-0.12 * width, 0.035, 0.46), (width / 2 - 0.015, depth - 0.015, 0.49), palette.cloth(rng), "blanket"
    )
    patches.append(sphere((-width / 2 + 0.3, 0.48, 0.53), 0.24, palette.cloth(rng), "pillow", squash=0.3))
    return patches


def shelf(rng: Rng, width: float, height: float) -> list[Patch]:
    """An open shelf with a back, full of books and ornaments."""
    depth, board, wood, tag = 0.30, 0.022, palette.wood(rng), "shelf"
    patches = box((-width / 2, 0.005, 0), (width / 2, 0.02, height), palette.wood(rng), tag)
    for x in (-width / 2, width / 2 - board):
        patches += box((x, 0.02, 0), (x + board, depth, height), wood, tag)
    levels = np.linspace(0.06, height - board, 6)
    for z in levels:
        patches += box((-width / 2 + board, 0.02, z), (width / 2 - board, depth, z + board), wood, tag)
    for z, above in pairwise(levels):
        room = above - z - board
        patches += placed(shelf_row(rng, width - 2 * board, depth - 0.06, room), (0.0, 0.03, z + board), 0.0)
    return patches


def shelf_row(rng: Rng, width: float, depth: float, room: float) -> list[Patch]:
    """What stands on one board: runs of books with gaps, a pot or a box between them."""
    patches, x = [], -width / 2 + 0.01
    while x < width / 2 - 0.12:
        kind = rng.random()
        if kind < 0.72:
            for _ in range(int(rng.integers(4, 9))):
                thick = rng.uniform(0.018, 0.05)
                if x + thick > width / 2 - 0.01:
                    break
                deep, high = rng.uniform(0.65, 1.0) * depth, rng.uniform(0.62, 0.93) * room
                patches += box((x, 0, 0), (x + thick, deep, high), palette.book(rng), "book", top=palette.PAGES)
                x += thick + 0.001
        elif kind < 0.88:
            radius = min(0.055, 0.3 * room)
            foot, glaze = (x + 0.07, 0.55 * depth, 0), palette.speckle(rng)
            patches += cylinder(foot, 0.6 * radius, 0.55 * room, glaze, "pot", radius)
            x += 0.13
        else:
            patches += box((x + 0.01, 0.1 * depth, 0), (x + 0.16, 0.9 * depth, 0.6 * room), palette.CARDBOARD, "carton")
            x += 0.17
        x += rng.uniform(0.0, 0.05)
    return patches


def cupboard(rng: Rng, width: float, height: float) -> list[Patch]:
    """A closed cupboard with two doors, handles and cartons on top."""
    depth, wood, tag = 0.42, palette.wood(rng), "cupboard"
    patches = box((-width / 2, 0.005, 0.0), (width / 2, depth, height), wood, tag)
    for side in (-1, 1):
        inner, outer = sorted((side * 0.006, side * (width / 2 - 0.01)))
        patches += box((inner, depth, 0.08), (outer, depth + 0.02, height - 0.02), wood, tag)
        low, high = inner + 0.07, outer - 0.07
        for z in (0.2, 0.55 * height):
            patches += box((low, depth + 0.02, z), (high, depth + 0.032, z + 0.36 * height), palette.wood(rng), tag)
        patches += leg_box(
            side * 0.035, depth + 0.045, 0.018, 0.48 * height, 0.53 * height, palette.DARK_METAL, "handle"
        )
    for x, tall in ((-0.22 * width, 0.24), (0.2 * width, 0.17)):
        carton = box((-0.17, -0.13, 0), (0.17, 0.13, tall), palette.CARDBOARD, "carton")
        patches += placed(carton, (x, 0.2, height), rng.uniform(-0.2, 0.2))
    return patches


def dresser(rng: Rng, width: float) -> list[Patch]:
    """A chest of drawers with a vase, a globe and books on top."""
    depth, height, wood, tag = 0.42, 0.80, palette.wood(rng), "dresser"
    patches = box((-width / 2, 0.005, 0.06), (width / 2, depth, height), wood, tag)
    for x in (-width / 2 + 0.04, width / 2 - 0.04):
        for y in (0.05, depth - 0.04):
            patches += leg_box(x, y, 0.04, 0.0, 0.06, wood, tag)
    front = palette.wood(rng)
    for z in (0.10, 0.33, 0.56):
        for low, high in ((-width / 2 + 0.02, -0.01), (0.01, width / 2 - 0.02)):
            patches += box((low, depth, z), (high, depth + 0.018, z + 0.21), front, tag)
            patches.append(sphere(((low + high) / 2, depth + 0.03, z + 0.11), 0.018, palette.DARK_METAL, "handle"))
    patches += cylinder((-0.33 * width, 0.2, height), 0.05, 0.24, palette.speckle(rng), "vase", 0.085)
    patches += cylinder((0.3 * width, 0.2, height), 0.07, 0.03, palette.DARK_METAL, "globe")
    patches.append(sphere((0.3 * width, 0.2, height + 0.16), 0.13, palette.painting(rng), "globe"))
    patches += placed(book_pile(rng, 3), (-0.02 * width, 0.22, height), rng.uniform(-0.3, 0.3))
    return patches


def floor_lamp(rng: Rng) -> list[Patch]:
    """A standing lamp (switched off): foot, thin pole, cloth shade."""
    patches = cylinder((0, 0, 0), 0.14, 0.025, palette.DARK_METAL, "lamp")
    patches += cylinder((0, 0, 0.025), 0.014, 1.4, palette.DARK_METAL, "lamp")
    return patches + cylinder((0, 0, 1.35), 0.19, 0.27, palette.cloth(rng), "lamp", 0.13)


def pouf(rng: Rng) -> list[Patch]:
    """A round cushion on the floor."""
    return [sphere((0, 0, 0.20), 0.26, palette.cloth(rng), "pouf", squash=0.77)]


def cartons(rng: Rng) -> list[Patch]:
    """Two cardboard boxes on one another."""
    patches = box((-0.22, -0.17, 0), (0.22, 0.17, 0.30), palette.CARDBOARD, "carton")
    upper = box((-0.16, -0.14, 0), (0.16, 0.14, 0.22), palette.CARDBOARD, "carton")
    return patches + placed(upper, (0.02, 0.0, 0.30), rng.uniform(-0.5, 0.5))


def picture(rng: Rng, width: float, height: float, material: Material) -> list[Patch]:
    """A framed picture; its lower edge is at z = 0."""
    bar, wood, tag = 0.03, palette.wood(rng), "picture"
    patches = box((-width / 2, 0.002, 0), (width / 2, 0.015, height), material, tag)
    for low, high in ((-width / 2, -width / 2 + bar), (width / 2 - bar, width / 2)):
        patches += box((low, 0.015, 0), (high, 0.03, height), wood, tag)
    for low, high in ((0.0, bar), (height - bar, height)):
        patches += box((-width / 2 + bar, 0.015, low), (width / 2 - bar, 0.03, high), wood, tag)
    return patches


def door(rng: Rng) -> list[Patch]:
    """A closed door with panels and a handle, standing on the floor."""
    wood, tag = palette.wood(rng), "door"
    patches = box((-0.47, 0.0, 0.0), (0.47, 0.03, 2.07), wood, tag)
    for z, height in ((0.18, 0.7), (1.05, 0.85)):
        for x in (-0.4, 0.04):
            patches += box((x, 0.03, z), (x + 0.36, 0.042, z + height), wood, tag)
    patches += cylinder((0.42, 0.055, 0.98), 0.02, 0.06, palette.DARK_METAL, "handle")
    return patches


def window(rng: Rng, width: float, height: float) -> list[Patch]:
    """A window with glaring panes: an emitter 1 cm before the wall in a frame; its lower edge is at z = 0."""
    wood, tag, bar = palette.wood(rng), "window", 0.06
    pane = parallelogram((width / 2, 0.01, 0), (-width, 0, 0), (0, 0, height), EMITTER, "light")
    patches = [pane]
    for low, high in ((-width / 2 - bar, -width / 2), (-0.02, 0.02), (width / 2, width / 2 + bar)):
        patches += box((low, 0.0, 0.0), (high, 0.05, height), wood, tag)
    for low, high in ((-bar, 0.0), (height, height + bar)):
        patches += box((-width / 2 - bar, 0.0, low), (width / 2 + bar, 0.05, high), wood, tag)
    sill = box((-width / 2 - 0.07, 0.0, -bar - 0.03), (width / 2 + 0.07, 0.16, -bar), wood, tag)
    return patches + sill


def curtains(rng: Rng, width: float, height: float) -> list[Patch]:
    """Two wavy curtains on a rod beside an opening of `width`; they hang from z = height to the floor."""
    fabric, rail = palette.cloth(rng), 0.42
    patches = box((-width / 2 - rail, 0.09, height), (width / 2 + rail, 0.11, height + 0.02), palette.DARK_METAL, "rod")
    for start in (-width / 2 - rail, width / 2 - 0.02):
        sheet = curtain(rail + 0.02, height - 0.04, 0.025, 5, fabric, "curtain")
        patches += placed([sheet], (start, 0.10, 0.04), 0.0)
    return patches


def carpet(rng: Rng, width: float, depth: float) -> list[Patch]:
    """A rug of 8 mm on the floor."""
    return box((-width / 2, -depth / 2, 0), (width / 2, depth / 2, 0.008), palette.rug(rng), "rug")
