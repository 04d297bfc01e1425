"""Silvered mirrors on the walls of a made room."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Patch, triangulated
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.render import ray_scene
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.layout import RandomRoom
from room2dgs.tools.random_rooms.shapes import box

GLASS = "silvered"  # tag of the patches that mirror
TRIES = 60  # places for each
DEEP = 0.012  # metres before the wall
IN_FRONT = 0.3  # metres that are free before the wall
HIGHEST = 2.2  # metres over the floor
SAMPLES = 7  # along each side, of the wall that must be free


def with_mirrors(room: RandomRoom, patches: list[Patch], count: int, rng: np.random.Generator) -> list[Patch]:
    """The patches and up to `count` mirrors, where the walls of the main space are free; half of them framed."""
    scene, space = ray_scene(triangulated(patches)), room.spaces[0]
    hung: list[tuple[int, float, float]] = []  # wall, from, to
    for _ in range(TRIES * count):
        if len(hung) == count:
            break
        wall = int(rng.integers(len(space.outline)))
        corner, length, yaw = space.wall(wall)
        size = np.exp(rng.uniform(np.log([0.4, 0.5]), np.log([1.6, 1.5])))
        framed, border = rng.random() < 0.5, rng.uniform(0.02, 0.06)
        if length < size[0] + 0.3:
            continue
        along = rng.uniform(0.15 + size[0] / 2, length - 0.15 - size[0] / 2)
        low = rng.uniform(0.3, max(0.31, HIGHEST - size[1]))
        if any(wall == other and along - size[0] < end and along + size[0] > start for other, start, end in hung):
            continue
        if not _free(scene, corner, yaw, along, low, size):
            continue
        hung.append((wall, along - size[0] / 2, along + size[0] / 2))
        piece = _mirror(rng, size, border if framed else 0.0)
        patches = [*patches, *space.on_wall(piece, wall, along, low)]
    return patches


def _mirror(rng: np.random.Generator, size: np.ndarray, border: float) -> list[Patch]:
    """In a wall's frame: x along it, y into the room; its middle below at 0."""
    half, high = size[0] / 2, float(size[1])
    deep, piece = DEEP, []
    if border:
        piece = box(
            (-half - border, 0.001, -border), (half + border, DEEP, high + border), materials.wood(rng), "frame"
        )
        deep = DEEP + 0.004
    return [*piece, *box((-half, 0.001, 0.0), (half, deep, high), materials.silver(rng), GLASS)]


def _free(scene, corner: np.ndarray, yaw: float, along: float, low: float, size: np.ndarray) -> bool:
    """Whether nothing is on the wall there, nor in a hand's reach before it."""
    across = along + np.linspace(-0.55, 0.55, SAMPLES) * size[0]
    up = low + np.linspace(-0.05, 1.05, SAMPLES) * size[1]
    x, z = (values.ravel() for values in np.meshgrid(across, up))
    points = np.column_stack([x, np.full(len(x), IN_FRONT)]) @ np.array(
        [[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]
    )
    start = np.column_stack([points + corner, z]).astype(np.float32)
    towards = np.broadcast_to(np.array([np.sin(yaw), -np.cos(yaw), 0.0], np.float32), start.shape)
    return bool((np.abs(cast(scene, start, towards)["t_hit"] - IN_FRONT) < 0.002).all())
