"""Doors, windows, passages and niches: the rectangles of each wall for which edges, sight and brightness speak most."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from room2dgs.lengths.length import Length
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.opening import Opening
from room2dgs.plan.opening_kinds import KINDS, Kind
from room2dgs.plan.outline import Side
from room2dgs.plan.rectangles import Rectangles, beside, candidates, rim, side_edges
from room2dgs.plan.sight import Rays
from room2dgs.plan.wall_map import CELL_M, WallMap, wall_map
from room2dgs.plan.wall_picture import Look

SHORTEST_WALL_M = 0.35
LEAST_SCORE = float(np.log(0.6 / 0.4))  # of what is named: likelier than not, and no tie
LEAST_VIEWS = 2  # of which rays look through an opening
ROOM_DEEP_M = 0.6  # behind a wall's plane: the back of a niche is nearer, another room's farther
SHINES = 0.5  # share of a pane in a recess
BACK = 0.8  # quantile of what lies behind a wall's plane: its back, and not what leads there
DOOR_WIDE_M = 1.25  # wider ones are passages
APART = 0.1  # of the smaller one's area: what two openings share at most
SWEEPS = 3  # over the sides of a rectangle, to fit them better
EDGE_SIGMA_M, LEAST_EDGE = 0.05, 0.25  # of a side that is a clear edge; strength below which it is no worse


@dataclass(frozen=True)
class _Found:
    """A rectangle on a wall, and what it is."""

    kind: Kind
    place: Rectangles
    score: float


def with_openings(plan: FloorPlan, rays: Rays, look: Look, scale: float) -> FloorPlan:
    """The plan with the openings of its rooms' walls.

    Args:
        rays: in the plan's level frame.
        look: the photos, in the plan's level frame.
        scale: relative deviation of the run's scale.
    """
    found: list[Opening] = []
    for number, room in enumerate(plan.rooms):
        for index, side in enumerate(room.sides):
            if side.wall is not None and side.length_m >= SHORTEST_WALL_M and _faces_in(plan, side):
                wall = wall_map(plan, side, rays, look)
                found += [replace(one, room=number, side=index) for one in _of_wall(wall, side.length_m, scale)]
    return replace(plan, openings=tuple(found))


def _faces_in(plan: FloorPlan, side: Side) -> bool:
    """Whether a side's wall is seen from its own room, which is on its left: the next room has its back."""
    along = side.end - side.start
    return bool(plan.walls[side.wall or 0].normal[:2] @ np.array([-along[1], along[0]]) > 0)


def _of_wall(wall: WallMap, length_m: float, scale: float) -> Iterator[Opening]:
    """The best of all kinds, then the best of those that are apart from it, and so on."""
    taken: list[Rectangles] = []
    best = [_best(wall, kind, taken) for kind in KINDS]
    while (found := max((one for one in best if one is not None), key=lambda one: one.score, default=None)) is not None:
        if (one := _opening(wall, found, length_m, scale)) is not None:
            yield one
        taken.append(found.place)
        best = [
            one if one is None or _shared(one.place, found.place)[0] <= APART else _best(wall, one.kind, taken)
            for one in best
        ]


def _best(wall: WallMap, kind: Kind, taken: list[Rectangles]) -> _Found | None:
    """The rectangle of a kind that is most likely there, apart from all that are taken; None: none is likely."""
    every = candidates(wall, kind.evidence(wall), kind.on_floor, kind.least_m)
    apart = np.ones(len(every), bool)
    for other in taken:
        apart &= _shared(every, other) <= APART
    every = every.of(apart)
    if not len(every):
        return None
    scores = kind.scores(wall, every)
    place = every.of(np.array([scores.argmax()]))
    for _ in range(SWEEPS):
        near = beside(place, wall.shape)
        scores = kind.scores(wall, near)
        place = near.of(np.array([scores.argmax()]))
    return _Found(kind, rim(wall, place, kind.framed), float(scores.max())) if scores.max() > LEAST_SCORE else None


def _shared(these: Rectangles, other: Rectangles) -> np.ndarray:
    """(R,) area that each has in common with one, over that of the smaller of both."""
    wide = np.minimum(these.right, other.right) - np.maximum(these.left, other.left)
    tall = np.minimum(these.high, other.high) - np.maximum(these.low, other.low)
    least = np.minimum(these.width_m * these.height_m, other.width_m * other.height_m)
    return np.maximum(wide, 0) * np.maximum(tall, 0) * CELL_M**2 / least


def _opening(wall: WallMap, found: _Found, length_m: float, scale: float) -> Opening | None:
    """None: too few views tell of it, or it has no name."""
    place, rays = found.place, wall.crossings
    x0, x1, z0, z1 = (float(at[0]) * CELL_M for at in (place.left, place.right, place.low, place.high))
    inside = (rays.along > x0) & (rays.along < x1) & (rays.up > z0) & (rays.up < z1)
    behind = inside & rays.through
    depth = float(np.quantile(rays.behind_m[behind], BACK)) if behind.sum() > 0.5 * inside.sum() else 0.0
    x1 = min(x1, length_m)
    name = _name(wall, found, x1 - x0, depth)
    if name is None or (found.kind.through and len(np.unique(rays.view[behind])) < LEAST_VIEWS):
        return None
    edges = np.append(side_edges(wall, place)[0], 1.0)[:4]  # that of the floor is known
    left, right, top, low = EDGE_SIGMA_M / np.maximum(edges, LEAST_EDGE)
    return Opening(
        name,
        found.kind.closed,
        0,
        0,
        x0,
        x1,
        z0,
        z1,
        depth if 0 < depth < ROOM_DEEP_M else None,
        float(1 / (1 + np.exp(-found.score))),
        _size(x1 - x0, left, right, scale),
        _size(z1 - z0, low if z0 > 0 else 0.0, top, scale),
    )


def _name(wall: WallMap, found: _Found, width_m: float, depth_m: float) -> str | None:
    """None: it may be a mirror, which is dark against its wall and shows a room."""
    kind, place = found.kind, found.place
    if not kind.through:
        return kind.name
    if kind.on_floor and depth_m > ROOM_DEEP_M:
        return "door" if width_m <= DOOR_WIDE_M else "passage"
    within = np.s_[place.left[0] : place.right[0], place.low[0] : place.high[0]]
    shines = wall.pane.found[within].sum() > SHINES * wall.pane.of[within].sum()
    if depth_m < ROOM_DEEP_M:
        return "window" if shines else "niche"
    shown = wall.color[within][wall.known[within]]
    return "window" if len(shown) and shown.mean() > wall.grey else None


def _size(value: float, one: float, other: float, scale: float) -> Length:
    return Length(value, 0.0, float(np.hypot(one, other)), scale * value, "edges in the photos, on the wall's plane")
