"""Potted plants: leaves on stems, fans of blades, little trees, vases of flowers."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.shapes import ellipsoid, flipped, lathe, moved, tube

Rng = np.random.Generator


def leaf(
    base, heading: float, rise: float, length: float, width: float, droop: float, material: Material
) -> list[Patch]:
    """A bent pointed leaf from `base`, with a back.

    Args:
        heading, rise: where it points at its base (radians), bending down by `droop` radians to its tip.
    """
    n = 5
    angle = rise - droop * np.linspace(0, 1, n + 1)
    out = np.concatenate([[0], np.cumsum(np.cos(angle[:-1]))]) * length / n
    up = np.concatenate([[0], np.cumsum(np.sin(angle[:-1]))]) * length / n
    half = 0.5 * width * np.sin(np.pi * (0.06 + 0.92 * np.linspace(0, 1, n + 1)) ** 0.8)
    keel = 0.25 * half
    rows = [
        np.column_stack([out, half, up + keel]),
        np.column_stack([out, 0 * out, up]),
        np.column_stack([out, -half, up + keel]),
    ]
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    grid = np.stack(rows[::-1]) @ turn.T + np.asarray(base)
    front = Patch(grid, (length, width), material, "leaf")
    return [front, flipped(front, (0.0, 0.0, -0.0015))]


def plant_pot(rng: Rng, radius: float) -> tuple[list[Patch], float]:
    """A pot with soil and the height of the soil."""
    height, foot, wall = radius * rng.uniform(1.2, 2.2), radius * rng.uniform(0.6, 1.0), 0.01
    soil = height * 0.88
    rim = [(radius, height), (radius - wall, height), (radius - wall, soil), (0, soil)]
    profile = [(0, 0), (foot, 0), *rim]
    material = (materials.ceramic, materials.plastic, materials.anything)[rng.integers(3)](rng)
    return [lathe(profile, material, "pot")], soil


def plant(rng: Rng, size: float | None = None) -> list[Patch]:
    """A potted plant about the origin, 0.15 to 2 m high."""
    size = size or float(np.exp(rng.uniform(np.log(0.2), np.log(1.8))))
    patches, soil = plant_pot(rng, float(np.clip(size * rng.uniform(0.12, 0.25), 0.04, 0.22)))
    green = materials.plant(rng)
    rest, kind = max(size - soil, 0.1), rng.integers(4)
    if kind == 0:  # blades from the ground
        for _ in range(int(rng.integers(8, 26))):
            rise = rng.uniform(0.8, 1.5)
            patches += leaf(
                (*rng.normal(0, 0.01, 2), soil),
                rng.uniform(-3.2, 3.2),
                rise,
                rest * rng.uniform(0.6, 1.1),
                rng.uniform(0.04, 0.12) * rest,
                rng.uniform(0.2, 1.6),
                green,
            )
        return patches
    if kind == 1:  # a trunk with a crown of large leaves
        patches.append(
            tube(
                [
                    (0, 0, 0.9 * soil),
                    (*rng.normal(0, 0.03, 2), soil + 0.3 * rest),
                    (*rng.normal(0, 0.04, 2), soil + 0.6 * rest),
                ],
                0.015 + 0.015 * rest,
                materials.wood(rng),
                "trunk",
            )
        )
        for _ in range(int(rng.integers(12, 36))):
            base = (*rng.normal(0, 0.03, 2), soil + rest * rng.uniform(0.3, 0.62))
            patches += leaf(
                base,
                rng.uniform(-3.2, 3.2),
                rng.uniform(-0.2, 1.4),
                rest * rng.uniform(0.2, 0.5),
                rest * rng.uniform(0.08, 0.25),
                rng.uniform(0, 1.5),
                green,
            )
        return patches
    if kind == 2:  # stems with leaves along them
        for _ in range(int(rng.integers(3, 8))):
            heading, lean = rng.uniform(-3.2, 3.2), rng.uniform(0.05, 0.7)
            t = np.linspace(0, 1, 5)
            out = lean * t**1.5 * rest * rng.uniform(0.6, 1)
            stem = np.column_stack(
                [out * np.cos(heading), out * np.sin(heading), soil - 0.01 + rest * t * (1 - 0.3 * lean * t)]
            )
            patches.append(tube(stem, 0.004 + 0.004 * rest, green, "stem", 6))
            for k in rng.uniform(0.25, 1, int(rng.integers(3, 8))):
                base = tuple(float(np.interp(k, t, stem[:, axis])) for axis in range(3))
                patches += leaf(
                    base,
                    rng.uniform(-3.2, 3.2),
                    rng.uniform(-0.4, 0.9),
                    rest * rng.uniform(0.1, 0.3),
                    rest * rng.uniform(0.05, 0.16),
                    rng.uniform(0, 1.2),
                    green,
                )
        return patches
    for _ in range(int(rng.integers(3, 9))):  # a bush of round clusters, or a cactus
        radius = rest * rng.uniform(0.12, 0.3)
        spot = (*rng.normal(0, 0.12 * rest, 2), soil + rng.uniform(0.3, 0.9) * rest - 0.3 * radius)
        patches += moved(
            [ellipsoid((radius, radius * rng.uniform(0.6, 1), radius * rng.uniform(0.6, 1.2)), green, "bush")], spot
        )
    return [
        *patches,
        tube([(0, 0, soil - 0.01), (0, 0, soil + 0.2 * rest), (0, 0, soil + 0.45 * rest)], 0.02, green, "stem"),
    ]
