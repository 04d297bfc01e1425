"""What is fixed to walls and ceilings: lamps, window frames, curtains, blinds, radiators, pictures, doors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box, curtain, disc, parallelogram
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.shapes import block, lathe, moved, rod, tube, two_sided
from room2dgs.tools.random_rooms.style import Style, carcass

Rng = np.random.Generator


def window_bars(rng: Rng, width: float, height: float, y: float, material: Material) -> list[Patch]:
    """Frame and glazing bars before a pane at `y`, x centred, from z = 0."""
    edge, bar, thick = rng.uniform(0.03, 0.09), rng.uniform(0.015, 0.06), rng.uniform(0.03, 0.07)
    h = width / 2
    patches = []
    for low, high in ((-h, edge - h), (h - edge, h)):
        patches += box((low, y, 0), (high, y + thick, height), material, "window")
    for low, high in ((0, edge), (height - edge, height)):
        patches += box((edge - h, y, low), (h - edge, y + thick, high), material, "window")
    for x in np.linspace(-h, h, int(rng.choice([1, 1, 2, 2, 3])) + 1)[1:-1]:
        patches += box((x - bar / 2, y, edge), (x + bar / 2, y + 0.8 * thick, height - edge), material, "window")
    for z in np.linspace(0, height, int(rng.choice([1, 1, 1, 2, 3])) + 1)[1:-1]:
        patches += box((edge - h, y, z - bar / 2), (h - edge, y + 0.7 * thick, z + bar / 2), material, "window")
    return patches


def pane(width: float, height: float, y: float, light: Material) -> Patch:
    """A shining pane facing +y, x centred, from z = 0."""
    return parallelogram((width / 2, y, 0), (-width, 0, 0), (0, 0, height), light, "light")


def flat_window(rng: Rng, style: Style, width: float, height: float, light: Material) -> list[Patch]:
    """A window set on the wall: pane, frame and sill."""
    frame = style.wood if rng.random() < 0.3 else materials.painted(rng)
    patches = [pane(width, height, 0.008, light), *window_bars(rng, width + 0.1, height, 0.0, frame)]
    deep = rng.uniform(0.06, 0.25)
    return patches + box((-width / 2 - 0.1, 0, -0.04), (width / 2 + 0.1, deep, 0), frame, "sill")


def curtains(rng: Rng, style: Style, width: float, height: float) -> list[Patch]:
    """Curtains on a rod before an opening of `width`: at its sides, on one side, or closed; z from 0."""
    fabric = style.cloth if rng.random() < 0.4 else materials.cloth(rng)
    out, wide, deep = rng.uniform(0.07, 0.14), rng.uniform(0.2, 0.5), rng.uniform(0.012, 0.035)
    h = width / 2
    patches = [rod((-h - wide, out, height), (h + wide, out, height), 0.012, style.metal, "rod")]
    kind = rng.random()
    spans = [(-h - wide, -h + 0.05), (h - 0.05, h + wide)]
    if kind < 0.2:
        spans = spans[:1]
    elif kind < 0.3:
        spans = [(-h - wide, h + wide)]
    low = rng.choice([0.02, 0.02, 0.3 * height])
    for left, right in spans:
        sheet = curtain(right - left, height - 0.02 - low, deep, 11 * (right - left), fabric, "curtain")
        patches += moved(two_sided(sheet, 0.004), (left, out, low))
    return patches


def blind(rng: Rng, style: Style, width: float, height: float) -> list[Patch]:
    """A blind before an opening: slats or a rolled sheet, hanging part of the way down from z = `height`."""
    material, drop = materials.painted(rng), height * rng.uniform(0.15, 0.9)
    patches = [rod((-width / 2, 0.06, height), (width / 2, 0.06, height), 0.025, material, "blind")]
    if rng.random() < 0.5:
        return patches + box((-width / 2, 0.058, height - drop), (width / 2, 0.062, height), material, "blind")
    tilt = rng.uniform(-0.7, 0.7)
    for z in np.arange(height - drop, height - 0.03, 0.05):
        slat = box((-width / 2, -0.02, -0.001), (width / 2, 0.02, 0.001), material, "blind")
        patches += moved(
            slat, (0, 0.06, z), np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
        )
    return patches


def ceiling_lamp(rng: Rng, style: Style, light: Material, hanging: bool = False) -> list[Patch]:
    """A lamp under the ceiling, hanging down from z = 0: a disc, a panel, a ball or a pendant.

    Args:
        hanging: no flat ones, for slanted ceilings.
    """
    kind, rim = rng.uniform(0.55 if hanging else 0.0, 1.0), style.metal
    if kind < 0.3:
        radius, thick = rng.uniform(0.12, 0.3), rng.uniform(0.03, 0.1)
        profile = [(0, -thick), (radius, -thick), (radius, 0), (0, 0)]
        return [lathe(profile, rim, "lamp"), disc((0, 0, -thick - 0.004), -0.94 * radius, light, "light")]
    if kind < 0.55:
        width, depth = rng.uniform(0.15, 1.2), rng.uniform(0.1, 0.6)
        patches = moved(block(width, depth, 0.05, rim, "lamp"), (0, 0, -0.05))
        corner = (-width / 2 + 0.01, -depth / 2 + 0.01, -0.054)
        return [*patches, parallelogram(corner, (0, depth - 0.02, 0), (width - 0.02, 0, 0), light, "light")]
    drop = rng.uniform(0.25, 0.9)
    patches = [rod((0, 0, -drop), (0, 0, 0), 0.004, materials.plastic(rng), "lamp")]
    if kind < 0.7:
        radius = rng.uniform(0.06, 0.18)
        t = np.linspace(-np.pi / 2, np.pi / 2, 11)
        half_circle = np.column_stack([radius * np.cos(t), radius * np.sin(t)])
        half_circle[[0, -1], 0] = 0
        return patches + moved([lathe(half_circle, light, "light", 18)], (0, 0, -drop - radius + 0.01))
    radius, tall = rng.uniform(0.1, 0.28), rng.uniform(0.1, 0.3)
    neck = radius * rng.uniform(0.1, 0.9)
    outer = [(radius, 0), (neck, tall)]
    inner = [(neck - 0.004, tall - 0.004), (radius - 0.004, 0)]
    shade = lathe([*outer, (0, tall + 0.002), (0, tall - 0.002), *inner, (radius, 0)], materials.anything(rng), "shade")
    bulb = disc((0, 0, 0.3 * tall), -0.5 * radius, light, "light")
    patches += moved(
        [shade, bulb, lathe([(0, 0.31 * tall), (0.02, 0.31 * tall), (0.02, tall), (0, tall)], rim, "lamp")],
        (0, 0, -drop - tall),
    )
    return patches


def floor_lamp(rng: Rng, style: Style, light: Material | None, height: float | None = None) -> list[Patch]:
    """A standing lamp about the origin; it shines up and down through its shade, or is off."""
    height = height or rng.uniform(1.2, 1.7)
    radius, foot = rng.uniform(0.11, 0.24), rng.uniform(0.1, 0.16)
    tall = rng.uniform(0.16, 0.35)
    patches = [
        lathe([(0, 0), (foot, 0), (foot, 0.02), (0.012, 0.035), (0.012, height), (0, height)], style.metal, "lamp")
    ]
    top = radius * rng.uniform(0.4, 1.0)
    if light is not None:
        shade = [(0, 0), (radius, 0), (top, tall), (0, tall)]
        glow = [replace(disc((0, 0, tall + 0.003), top * 0.95, light), tag="light")]
        glow.append(disc((0, 0, -0.003), -radius * 0.95, light, "light"))
    else:
        shade = [(radius, 0), (top, tall), (top - 0.004, tall), (radius - 0.004, 0), (radius, 0)]
        glow = []
    body = lathe(shade, materials.cloth(rng) if rng.random() < 0.7 else materials.painted(rng), "shade")
    return patches + moved(
        [body, *glow], (0, 0, height - 0.6 * tall + (0.004 if light is None else 0.6 * tall + 0.004))
    )


def radiator(rng: Rng, style: Style) -> list[Patch]:
    """A radiator at the wall: flat, ribbed or of columns."""
    width, height, material = rng.uniform(0.4, 1.4), rng.uniform(0.4, 0.75), materials.painted(rng)
    kind, low = rng.integers(3), rng.uniform(0.08, 0.2)
    patches: list[Patch] = []
    if kind < 2:
        patches += box((-width / 2, 0.03, low), (width / 2, 0.09, low + height), material, "radiator")
    if kind == 1:
        for x in np.arange(-width / 2 + 0.03, width / 2 - 0.02, 0.06):
            patches += box((x, 0.09, low + 0.03), (x + 0.03, 0.1, low + height - 0.03), material, "radiator")
    if kind == 2:
        for x in np.arange(-width / 2, width / 2, 0.07):
            patches += [rod((x, 0.08, low), (x, 0.08, low + height), 0.025, material, "radiator")]
        for z in (low + 0.06, low + height - 0.06):
            patches.append(rod((-width / 2, 0.08, z), (width / 2, 0.08, z), 0.02, material, "radiator"))
    return [*patches, rod((width / 2, 0.06, 0.0), (width / 2, 0.06, low + 0.1), 0.01, material, "pipe")]


def picture(rng: Rng, style: Style) -> list[Patch]:
    """A picture, poster, mirror, board, clock or map at the wall; its lower edge at z = 0."""
    width, height = rng.uniform(0.15, 1.3), rng.uniform(0.15, 1.0)
    kind = rng.random()
    if kind < 0.15:
        return box((-width / 2, 0, 0), (width / 2, 0.003, height), materials.picture(rng), "poster")
    if kind < 0.22:
        radius = rng.uniform(0.1, 0.25)
        clock = lathe(
            [(0, 0), (radius, 0), (radius, 0.03), (0.9 * radius, 0.035), (0, 0.03)], materials.anything(rng), "clock"
        )
        turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        return moved([clock], (0, 0, radius), turn)
    inner = materials.glass_like(rng) if kind < 0.32 else materials.picture(rng)
    bar, frame = rng.uniform(0.01, 0.07), carcass(rng, style)
    h, deep = width / 2, rng.uniform(0.015, 0.05)
    patches = box((-h, 0.001, 0), (h, 0.6 * deep, height), inner, "picture")
    for low, high in ((-h - 0.001, bar - h), (h - bar, h + 0.001)):
        patches += box((low, 0.0, -0.001), (high, deep, height + 0.001), frame, "picture")
    for low, high in ((0.0, bar), (height - bar, height)):
        patches += box((bar - h, 0.0, low), (h - bar, deep, high), frame, "picture")
    return patches


def door_leaf(rng: Rng, style: Style, width: float, height: float) -> list[Patch]:
    """A door leaf hinged at the origin, x from 0 to width, facing +y, with panels and handles."""
    material, thick = carcass(rng, style), 0.04
    patches = box((0, -thick, 0.005), (width, 0, height), material, "door")
    if rng.random() < 0.5:
        for low, high in ((0.12, 0.42), (0.48, 0.92)) if rng.random() < 0.6 else ((0.08, 0.92),):
            inner = materials.glass_like(rng) if rng.random() < 0.15 else material
            patches += box((0.13 * width, 0, low * height), (0.87 * width, 0.012, high * height), inner, "door")
            patches += box(
                (0.13 * width, -thick - 0.012, low * height), (0.87 * width, -thick, high * height), inner, "door"
            )
    for side in (0.0, -thick):
        out = 0.05 if side == 0 else -0.05
        x = width - 0.06
        patches.append(rod((x, side, 1.0), (x, side + out, 1.0), 0.01, style.metal, "handle"))
        patches.append(rod((x + 0.01, side + out, 1.0), (x - 0.12, side + out, 1.0), 0.009, style.metal, "handle"))
    return patches


def door_frame(rng: Rng, width: float, height: float, material: Material, thick: float = 0.02) -> list[Patch]:
    """Boards around an opening of `width` (x centred) on the wall y = 0."""
    wide, h = rng.uniform(0.05, 0.12), width / 2
    patches = box((-h - wide, 0, 0), (-h, thick, height + wide), material, "frame")
    patches += box((h, 0, 0), (h + wide, thick, height + wide), material, "frame")
    return patches + box((-h, 0, height), (h, thick, height + wide), material, "frame")


def closed_door(rng: Rng, style: Style) -> list[Patch]:
    """A closed door in its frame at the wall."""
    width, height = rng.uniform(0.7, 1.0), rng.uniform(1.95, 2.1)
    leaf = moved(door_leaf(rng, style, width, height), (-width / 2, 0.045, 0))
    return leaf + door_frame(rng, width, height, carcass(rng, style), 0.03)


def rug(rng: Rng, style: Style) -> list[Patch]:
    """A flat rug about the origin, rectangular or round."""
    material, thick = materials.rug(rng) if rng.random() < 0.7 else materials.cloth(rng), rng.uniform(0.004, 0.02)
    width, depth = rng.uniform(0.6, 3.0), rng.uniform(0.5, 2.2)
    if rng.random() < 0.25:
        radius = 0.5 * min(width, depth)
        return [lathe([(radius, 0), (radius, thick), (0, thick)], material, "rug", 32)]
    return block(width, depth, thick, material, "rug")


def pipes(rng: Rng, style: Style, height: float) -> list[Patch]:
    """Pipes or a duct up a wall, or a cable channel."""
    radius = rng.uniform(0.008, 0.07)
    out = radius + 0.01
    turn = [(0, out, 0.0), (0, out, 0.6 * height), (0.0, out, height - 0.02)]
    return [tube(turn, radius, materials.painted(rng), "pipe", 16)]


def sockets(rng: Rng, style: Style) -> list[Patch]:
    """A light switch or a row of sockets; z = 0 is its lower edge."""
    width = 0.08 * int(rng.integers(1, 4))
    return box((-width / 2, 0, 0), (width / 2, 0.012, 0.08), materials.plastic(rng), "switch")
