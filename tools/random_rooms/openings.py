"""Holes in the walls of a room: doorways with a space behind, windows, niches."""

from __future__ import annotations

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch
from room2dgs.tools.random_rooms import fittings, materials, shell
from room2dgs.tools.random_rooms.draft import Draft
from room2dgs.tools.random_rooms.shapes import moved, rotation
from room2dgs.tools.random_rooms.shell import Opening, Space

Rng = np.random.Generator


def claim_behind(draft: Draft, wall: int, start: float, end: float, depth: float) -> bool:
    """Reserves the solid behind a stretch of wall; False if some space or recess is already there."""
    corner, _, yaw = draft.space.wall(wall)
    x, y = np.meshgrid(np.linspace(start, end, 12), np.linspace(-depth, -0.02, 12))
    points = np.column_stack([x.ravel(), y.ravel()]) @ rotation(yaw)[:2, :2].T + corner
    if draft.space.contains(points).any():
        return False
    if any(shell.in_polygon(points, outline).any() for outline in draft.behind):
        return False
    local = np.array([(start, -depth), (end, -depth), (end, -0.01), (start, -0.01)])
    draft.behind.append(local @ rotation(yaw)[:2, :2].T + corner)
    return True


def doorway(rng: Rng, draft: Draft) -> Draft | None:
    """An open passage to another space; returns that space as a draft to be lit and filled, or None."""
    wall = draft.walls[rng.integers(len(draft.walls))]
    width = rng.uniform(0.7, 1.0) if rng.random() < 0.75 else rng.uniform(1.0, 2.4)
    height = rng.uniform(1.95, 2.15) if rng.random() < 0.85 else rng.uniform(2.15, 2.5)
    spot = wall.free_spot(rng, width + 0.16, 0.0, height + 0.05)
    if spot is None:
        return None
    depth, room = rng.uniform(0.06, 0.3), rng.uniform(0.9, 4.0)
    left, right = spot - width / 2 - rng.uniform(0.05, 1.8), spot + width / 2 + rng.uniform(0.05, 1.8)
    if not claim_behind(draft, wall.index, left - 0.02, right + 0.02, depth + room + 0.02):
        left, right, room = spot - width / 2 - 0.05, spot + width / 2 + 0.05, rng.uniform(0.9, 1.4)
        if not claim_behind(draft, wall.index, left - 0.02, right + 0.02, depth + room + 0.02):
            return None
    wall.take(spot, width + 0.16, 0.0, height + 0.1)
    draft.recess_limit[wall.index] = depth - 0.01
    hole = Opening(spot - width / 2, spot + width / 2, 0.0, height, "door")
    draft.space.openings.setdefault(wall.index, []).append(hole)
    corner, _, yaw = draft.space.wall(wall.index)
    local = np.array([(left, -depth - room), (right, -depth - room), (right, -depth), (left, -depth)])
    outline = local @ rotation(yaw)[:2, :2].T + corner
    tall = max(height + 0.05, float(np.clip(rng.normal(2.55, 0.2), 2.2, 3.4)))
    other = Space(outline, np.array([(-1e3, tall), (1e3, tall)]))
    other.openings[2] = [Opening(right - hole.end, right - hole.start, 0.0, height, "door")]
    frame = draft.style.wood if rng.random() < 0.4 else materials.painted(rng)
    patches = shell.reveal(hole, depth, frame, materials.wood(rng) if rng.random() < 0.5 else materials.floor(rng))
    if rng.random() < 0.7:
        patches += moved(fittings.door_frame(rng, width, height, frame), (spot, 0, 0))
    if rng.random() < 0.45 and width < 1.05:
        patches += open_leaf(rng, draft, spot, width, height)
    draft.patches += draft.space.on_wall(patches, wall.index, 0.0)
    draft.plan.keep_free(draft.space, wall.index, spot, width, 0.7)
    behind = Draft(other, draft.style)
    behind.walls[2].take(right - spot, width + 0.1, 0.0, height + 0.05)
    behind.plan.keep_free(other, 2, right - spot, width, 0.6)
    return behind


def open_leaf(rng: Rng, draft: Draft, spot: float, width: float, height: float) -> list[Patch]:
    """A door leaf that stands open into the room by 20 to 170 degrees, in the wall's frame."""
    angle = rng.uniform(0.35, 2.9)
    leaf = fittings.door_leaf(rng, draft.style, width - 0.02, height - 0.01)
    if rng.random() < 0.5:
        return moved(leaf, (spot - width / 2, 0.025, 0), angle)
    mirror = [Patch((patch.grid * (-1, 1, 1))[:, ::-1], patch.size, patch.material, patch.tag) for patch in leaf]
    return moved(mirror, (spot + width / 2, 0.025, 0), -angle)


def window(rng: Rng, draft: Draft, light: Material) -> bool:
    """A window in a recess or set on the wall, often with a curtain or a blind; False if there was no room."""
    wall = draft.walls[rng.integers(len(draft.walls))]
    width, low = rng.uniform(0.5, 2.2), rng.choice([0.0, 0.4, 0.9, 1.1, 1.5], p=[0.1, 0.13, 0.45, 0.22, 0.1])
    height = rng.uniform(0.6, 1.5) if low else rng.uniform(1.9, 2.2)
    height = min(height, max(0.45, 2.25 - low))
    spot = wall.free_spot(rng, width + 0.3, low, low + height + 0.1)
    if spot is None:
        return False
    recess = rng.uniform(0.05, 0.35) if rng.random() < 0.65 else 0.0
    recess = min(recess, draft.recess_limit.get(wall.index, 1.0))
    if recess < 0.05 or not claim_behind(draft, wall.index, spot - width / 2, spot + width / 2, recess):
        recess = 0.0
    wall.take(spot, width + 0.2, low - 0.05, low + height + 0.1)
    if recess:
        hole = Opening(spot - width / 2, spot + width / 2, low, low + height, "window")
        draft.space.openings.setdefault(wall.index, []).append(hole)
        frame = materials.painted(rng) if rng.random() < 0.8 else draft.style.wood
        patches = shell.reveal(hole, recess, materials.painted(rng), materials.stone(rng))
        patches.append(shell.back_face(hole, recess, light, "light"))
        patches += moved(fittings.window_bars(rng, width, height, -recess + 0.002, frame), (spot, 0, low))
    else:
        patches = moved(fittings.flat_window(rng, draft.style, width, height, light), (spot, 0, low))
        framed = Opening(spot - width / 2 - 0.05, spot + width / 2 + 0.05, low, low + height, "window")
        draft.space.mounted.setdefault(wall.index, []).append(framed)
    top = wall.height(spot, width)
    dressing = rng.random()
    if dressing < 0.35 and low + height + 0.15 < top:
        patches += moved(fittings.curtains(rng, draft.style, width, low + height + 0.12), (spot, 0, 0))
    elif dressing < 0.5:
        patches += moved(fittings.blind(rng, draft.style, width, height), (spot, 0, low))
    draft.patches += draft.space.on_wall(patches, wall.index, 0.0)
    return True


def niche(rng: Rng, draft: Draft) -> None:
    """A shallow recess in a wall."""
    wall = draft.walls[rng.integers(len(draft.walls))]
    width, height, low = rng.uniform(0.25, 1.6), rng.uniform(0.25, 2.0), rng.choice([0.0, 0.5, 1.0, 1.3])
    spot = wall.free_spot(rng, width + 0.1, low, low + height + 0.05)
    depth = min(rng.uniform(0.08, 0.45), draft.recess_limit.get(wall.index, 1.0))
    if spot is None or depth < 0.05 or not claim_behind(draft, wall.index, spot - width / 2, spot + width / 2, depth):
        return
    wall.take(spot, width + 0.05, low, low + height)
    hole = Opening(spot - width / 2, spot + width / 2, low, low + height, "niche")
    draft.space.openings.setdefault(wall.index, []).append(hole)
    cover = materials.painted(rng) if rng.random() < 0.5 else materials.wall(rng)
    patches = [*shell.reveal(hole, depth, cover), shell.back_face(hole, depth, cover, "niche")]
    draft.patches += draft.space.on_wall(patches, wall.index, 0.0)
