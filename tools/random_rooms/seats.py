"""Chairs, stools, armchairs, sofas and beds.

Chairs are centred on the origin with the back at -y; sofas and beds stand at the wall y = 0 (x centred).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.shapes import (
    bar,
    cushion,
    lathe,
    moved,
    rod,
    rotation,
    rounded_box,
    tube,
)
from room2dgs.tools.random_rooms.style import Style, carcass, fabric

Rng = np.random.Generator


def soft_box(low, high, radius: float, material: Material, tag: str) -> list[Patch]:
    """A rounded box from corner to corner; a sharp one where the radius is small."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    if radius < 0.012:
        return box(low, high, material, tag)
    return moved([rounded_box((high - low) / 2, radius, material, tag, step=0.08)], (low + high) / 2)


def leg(start, end, width: float, material: Material, round_leg: bool) -> list[Patch]:
    """A leg between two points, square or round and tapered."""
    if round_leg:
        return [rod(end, start, 0.5 * width, material, "leg", 0.6 * width)]
    return bar(end, start, width, material, "leg")


def four_legs(rng: Rng, half_x: float, half_y: float, height: float, material: Material, width: float) -> list[Patch]:
    """Legs under the corners of a rectangle, upright or spread."""
    spread, round_leg = (rng.uniform(0, 0.08) if rng.random() < 0.5 else 0.0), rng.random() < 0.4
    patches = []
    for x in (-half_x, half_x):
        for y in (-half_y, half_y):
            foot = (x + np.sign(x) * spread, y + np.sign(y) * spread, 0.0)
            patches += leg((x, y, height), foot, width, material, round_leg)
    return patches


def chair(rng: Rng, style: Style) -> list[Patch]:
    """A chair: legs and slats, a shell, or an upholstered one."""
    wood, seat = carcass(rng, style), fabric(rng, style) if rng.random() < 0.5 else carcass(rng, style)
    half, height, top = rng.uniform(0.19, 0.23), rng.uniform(0.42, 0.48), rng.uniform(0.76, 1.05)
    thick = rng.uniform(0.02, 0.07)
    patches = soft_box((-half, -half, height - thick), (half, half, height), rng.choice([0.0, 0.02]), seat, "chair")
    leg_wood = wood if rng.random() < 0.7 else style.metal
    patches += four_legs(rng, half - 0.03, half - 0.03, height - thick, leg_wood, rng.uniform(0.02, 0.04))
    kind, lean = rng.integers(4), rng.uniform(0.0, 0.2)
    back: list[Patch] = []
    rise = top - height
    if kind == 0:
        for x in np.linspace(-half + 0.03, half - 0.03, int(rng.integers(2, 7))):
            back += box((x - 0.012, -0.012, 0.0), (x + 0.012, 0.012, rise), wood, "chair")
        for z in (0.5 * rise, rise - 0.06):
            back += box((-half, -0.014, z), (half, 0.016, z + rng.uniform(0.04, 0.09)), wood, "chair")
    elif kind == 1:
        for x in (-half + 0.02, half - 0.02):
            back += box((x - 0.015, -0.015, 0.0), (x + 0.015, 0.015, rise), wood, "chair")
        for z in np.linspace(0.2 * rise, rise - 0.07, int(rng.integers(2, 5))):
            back += box((-half, -0.01, z), (half, 0.01, z + 0.05), wood, "chair")
    elif kind == 2:
        back += soft_box((-half, -0.03, 0.03), (half, 0.03, rise), 0.025, seat, "chair")
    else:
        back += curved_back(rng, half, rise, seat)
    return patches + moved(back, (0, -half + 0.03, height), rotation(0, 0, lean))


def curved_back(rng: Rng, half: float, rise: float, material: Material) -> list[Patch]:
    """A bent shell around the sitter, open to +y, standing on z = 0 with its middle at y = 0."""
    span, thick = rng.uniform(0.8, 2.0), 0.018
    angle = np.linspace(-span / 2, span / 2, 13)
    radius = half / np.sin(min(span / 2, 1.5))
    shell = []
    for reach, turn in ((radius, 1), (radius - thick, -1)):
        ring = np.column_stack([reach * np.sin(angle), radius - reach * np.cos(angle), 0 * angle])[::turn]
        shell.append(ring)
    outer, inner = shell
    up = np.array([0.0, 0.0, rise])
    ring = np.concatenate([outer, inner, outer[:1]])
    size = (2.2 * radius * span, rise)
    side = Patch(np.stack([ring, ring + up]), size, material, "chair")
    rim = Patch(np.stack([outer, inner[::-1]]) + up, (radius * span, thick), material, "chair")
    return [side, rim]


def stool(rng: Rng, style: Style) -> list[Patch]:
    """A round or square stool, low or as high as a bar."""
    height, radius = rng.choice([0.45, 0.65, 0.75]), rng.uniform(0.14, 0.2)
    wood = carcass(rng, style)
    if rng.random() < 0.5:
        t = 0.04
        profile = [(0, 0), (radius - 0.01, 0), (radius, 0.01), (radius, t - 0.01), (radius - 0.01, t), (0, t)]
        patches = moved([lathe(profile, wood, "stool")], (0, 0, height - t))
    else:
        patches = soft_box(
            (-radius, -radius, height - 0.05), (radius, radius, height), 0.02, fabric(rng, style), "stool"
        )
    if rng.random() < 0.3:
        pole = [(0, 0), (0.2, 0), (0.2, 0.015), (0.03, 0.03), (0.03, height - 0.04), (0, height - 0.04)]
        return [*patches, lathe(pole, style.metal, "stool")]
    return patches + four_legs(rng, 0.6 * radius, 0.6 * radius, height - 0.04, wood, 0.03)


def office_chair(rng: Rng, style: Style) -> list[Patch]:
    """A swivel chair: five feet with castors, a gas spring, seat, back, armrests."""
    dark, seat = materials.plastic(rng), fabric(rng, style)
    patches = [rod((0, 0, 0.08), (0, 0, 0.44), 0.028, style.metal, "chair")]
    for angle in np.arange(5) * 2 * np.pi / 5 + rng.uniform(0, 1):
        tip = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.07])
        patches += bar((0, 0, 0.1), tip, 0.04, dark, "chair")
        patches += moved([lathe([(0, 0), (0.028, 0), (0.028, 0.05), (0, 0.05)], dark, "chair")], tip - (0, 0, 0.07))
    patches += moved([rounded_box((0.25, 0.24, 0.045), 0.04, seat, "chair", bulge=0.2)], (0, 0, 0.48))
    back = [rounded_box((0.22, 0.04, rng.uniform(0.22, 0.38)), 0.038, seat, "chair")]
    patches += moved(back, (0, -0.25, 0.9), rotation(0, 0, rng.uniform(0, 0.25)))
    patches += bar((0, -0.18, 0.44), (0, -0.28, 0.75), 0.05, dark, "chair", 0.02)
    if rng.random() < 0.6:
        for x in (-0.27, 0.27):
            patches += bar((x, -0.05, 0.46), (x, -0.05, 0.68), 0.03, dark, "chair")
            patches += box((x - 0.03, -0.2, 0.68), (x + 0.03, 0.12, 0.71), dark, "chair")
    return patches


def seat_group(rng: Rng, style: Style, width: float, seats: int) -> list[Patch]:
    """An armchair or sofa at the wall: base, back, arms, cushions, all sharp or all soft."""
    fabric_, depth, tag = fabric(rng, style), rng.uniform(0.75, 1.0), "sofa"
    radius = 0.0 if rng.random() < 0.3 else rng.uniform(0.03, 0.12)
    arm, back, foot = rng.uniform(0.08, 0.25), rng.uniform(0.12, 0.3), rng.uniform(0.02, 0.16)
    base, top, arm_top = rng.uniform(0.22, 0.32), rng.uniform(0.65, 0.95), rng.uniform(0.45, 0.68)
    seat_top = base + rng.uniform(0.12, 0.2)
    h = width / 2
    patches = soft_box((-h, 0.02, foot), (h, depth, base), min(radius, 0.03), fabric_, tag)
    patches += soft_box((-h, 0.02, base - 0.05), (h, back, top), radius, fabric_, tag)
    if rng.random() < 0.88:
        for side in (-1, 1):
            low, high = sorted((side * h, side * (h - arm)))
            patches += soft_box((low, 0.05, base - 0.05), (high, depth, arm_top), radius, fabric_, tag)
    else:
        arm = 0.0
    cover = fabric_ if rng.random() < 0.7 else fabric(rng, style)
    edges = np.linspace(-h + arm, h - arm, seats + 1)
    for left, right in pairwise(edges):
        near, far = (left + 0.005, back - 0.02, base - 0.01), (right - 0.005, depth + 0.02, seat_top)
        patches += soft_box(near, far, min(radius + 0.02, 0.07), cover, tag)
        if rng.random() < 0.6:
            rest = soft_box((-0.47 * (right - left), -0.09, 0), (0.47 * (right - left), 0.07, 0.45), 0.07, cover, tag)
            patches += moved(rest, ((left + right) / 2, back + 0.08, seat_top), rotation(0, 0, 0.2))
    for x in (-h + 0.08, h - 0.08):
        for y in (0.1, depth - 0.08):
            patches.append(rod((x, y, 0), (x, y, foot), 0.025, style.wood, tag))
    for _ in range(int(rng.integers(0, 2 + seats))):
        pillow = cushion(rng.uniform(0.35, 0.5), rng.uniform(0.35, 0.5), 0.13, materials.cloth(rng))
        turn = rotation(rng.normal(0, 0.4), 0, rng.uniform(0.7, 1.4))
        patches += moved(pillow, (rng.uniform(-0.7, 0.7) * edges[-1], back + 0.22, seat_top + 0.2), turn)
    if rng.random() < 0.25:
        spread = rng.uniform(0.4, 0.9)
        patches += moved(throw(rng, spread, depth + 0.03, seat_top), (rng.uniform(-0.2, 0.2) * width, 0, 0))
    return patches


def throw(rng: Rng, width: float, depth: float, height: float) -> list[Patch]:
    """A blanket over the seat, hanging down the front."""
    material, n = materials.cloth(rng), 12
    path = [(0.25, height + 0.025), (depth - 0.05, height + 0.025), (depth + 0.02, height - 0.02)]
    path += [(depth + 0.025, height - rng.uniform(0.15, 0.35))]
    x = np.linspace(-width / 2, width / 2, n)
    rows = np.array([[(a, y + 0.008 * np.sin(20 * a), z) for a in x] for y, z in path])
    return [Patch(rows, (width, depth), material, "throw")]


def armchair(rng: Rng, style: Style) -> list[Patch]:
    """An armchair at the wall."""
    if rng.random() < 0.3:
        return moved(tub_chair(rng, style), (0, 0.42, 0))
    return seat_group(rng, style, rng.uniform(0.75, 1.05), 1)


def tub_chair(rng: Rng, style: Style) -> list[Patch]:
    """A round armchair about the origin: a thick bent back around a round cushion."""
    cover = fabric(rng, style)
    t = np.linspace(-2.2, 2.2, 17) - np.pi / 2
    path = np.column_stack(
        [0.33 * np.cos(t), 0.33 * np.sin(t), np.full(len(t), 0.62) - 0.1 * np.abs(np.linspace(-1, 1, 17))]
    )
    patches = [tube(path, 0.085, cover, "armchair", 14)]
    low = path * (1, 1, 0) + (0, 0, 0.22)
    patches += [tube(low + np.array([0, 0, step]), 0.08, cover, "armchair", 12) for step in (0.0, 0.09, 0.18, 0.27)]
    seat = [(0, 0), (0.3, 0), (0.34, 0.05), (0.34, 0.1), (0.3, 0.15), (0.15, 0.17), (0, 0.175)]
    patches += moved([lathe(seat, cover, "armchair")], (0, 0, 0.28))
    base = [(0, 0), (0.3, 0), (0.33, 0.24), (0, 0.24)]
    return [
        *patches,
        *moved([lathe(base, cover, "armchair")], (0, 0, 0.06)),
        *four_legs(rng, 0.2, 0.2, 0.07, style.wood, 0.04),
    ]


def sofa(rng: Rng, style: Style) -> list[Patch]:
    """A sofa at the wall for two to four, at times with a long arm."""
    width = rng.uniform(1.4, 2.6)
    patches = seat_group(rng, style, width, int(rng.integers(1, 5)))
    if rng.random() < 0.2:
        cover = fabric(rng, style)
        side = rng.choice([-1, 1]) * (width / 2 - 0.4)
        patches += moved(soft_box((-0.4, 0.7, 0.05), (0.4, 1.7, 0.44), 0.05, cover, "sofa"), (side, 0, 0))
    return patches


def bed(rng: Rng, style: Style) -> list[Patch]:
    """A bed with its head at the wall: frame, mattress, duvet, pillows."""
    width, length = rng.choice([0.9, 1.2, 1.4, 1.6, 1.8]), rng.uniform(1.9, 2.15)
    wood, frame, h = carcass(rng, style), rng.uniform(0.2, 0.36), 0.0
    h = width / 2
    patches: list[Patch] = []
    if rng.random() < 0.5:
        patches += box((-h, 0.03, 0.0 if rng.random() < 0.4 else 0.12), (h, length, frame), wood, "bed")
    else:
        patches += box((-h, 0.03, frame - 0.14), (h, length, frame), wood, "bed")
    patches += moved(four_legs(rng, h - 0.05, length / 2 - 0.08, frame - 0.1, wood, 0.05), (0, length / 2, 0))
    head = rng.uniform(0.5, 1.2)
    cover = fabric(rng, style) if rng.random() < 0.4 else wood
    patches += soft_box((-h - 0.03, 0.0, 0.0), (h + 0.03, 0.07, head), rng.choice([0.0, 0.03]), cover, "bed")
    if rng.random() < 0.3:
        patches += box((-h - 0.02, length, 0.0), (h + 0.02, length + 0.04, frame + rng.uniform(0, 0.3)), wood, "bed")
    top = frame + rng.uniform(0.12, 0.24)
    patches += soft_box((-h + 0.01, 0.06, frame), (h - 0.01, length - 0.02, top), 0.05, materials.cloth(rng), "bed")
    start = rng.uniform(0.35, 0.9)
    patches += [duvet(rng, width, start, length, top, style)]
    for x in np.linspace(-h, h, 1 + (1 if width < 1.3 else 2) + 1)[1:-1]:
        pillow = cushion(min(0.7, 0.8 * width), 0.4, rng.uniform(0.12, 0.2), materials.cloth(rng))
        turn = rotation(rng.normal(0, 0.15), 0, rng.uniform(0, 0.8))
        patches += moved(pillow, (x, 0.3, top + 0.03), turn)
    return patches


def duvet(rng: Rng, width: float, start: float, end: float, top: float, style: Style) -> Patch:
    """A puffy wavy cover over the mattress, hanging over its sides."""
    n, m = 21, 17
    over, drop, thick = rng.uniform(0.0, 0.08), rng.uniform(0.02, 0.3), rng.uniform(0.03, 0.09)
    s, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(start, end + 0.02, m))
    k = rng.uniform(2, 9, 4)
    waves = np.sin(k[0] * s + k[1] * y + rng.uniform(0, 6)) + np.sin(k[2] * s - k[3] * y + rng.uniform(0, 6))
    flat = np.abs(s) < 0.8
    side = np.clip((np.abs(s) - 0.8) / 0.2, 0, 1)
    x = np.sign(s) * np.minimum(np.abs(s) / 0.8, 1) * (width / 2 + over * side)
    ends = np.clip(np.minimum(y - start, end + 0.02 - y) / 0.12, 0, 1) ** 0.5
    z = top + thick * (0.35 + 0.65 * ends) + 0.012 * waves * flat * ends - side * (drop + thick)
    z = np.where(flat, z, np.maximum(z, 0.05))
    return Patch(np.stack([x, y, z], -1), (width + 2 * drop, end - start), fabric(rng, style), "duvet")
