"""Doors, windows, passages and niches: where views look through a wall's plane, or meet what is fixed on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from room2dgs.lengths.length import Length
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.opening import Opening
from room2dgs.plan.outline import Side
from room2dgs.plan.sight import Rays

CELL_M = 0.05
THROUGH_M = 0.07  # behind a wall's plane: what a view sees there it sees through an opening
BEFORE_M = 0.025, 0.075  # of a closed door before its wall
LEAST_RAYS = 2  # of a cell
OPEN_SHARE = 0.5  # of a cell's rays
SMALLEST_M = 0.35  # side of an opening
FILLED = 0.55  # of an opening's rectangle, by cells that say so
LEAST_VIEWS = 2
LEAST_WALL_RAYS = 15  # below a window: what tells that there is a wall
DOOR_LOW_M, DOOR_HIGH_M = 0.25, 1.75  # a door begins below the first and ends above the second
HIDDEN_LOW_M = 0.7  # up to which furniture hides the lower part of a door
DOOR_WIDE_M = 1.25  # wider ones are passages
CLOSED_M = (0.6, 1.35), (1.85, 2.3)  # width and height of a closed door with its frame
NICHE_M = 0.6  # depth up to which what is behind is a niche, or a window's pane
BRIGHT, BRIGHTER = 0.92, 1.25  # grey level of a window's pane; over that of its wall
EDGE_M = 0.25  # around a rough edge, where the exact one is sought
EDGE_SIGMA_M = 0.03  # of an edge, at least: frames and reveals are no lines, and small maps of depth blur there
ON_WALL_M = 0.035  # of a wall's plane: a ray that ends there meets the wall
FATTENING_PX = 2.5  # of a small map's pixels: depth takes what lies before a deep opening for so much wider
FRAME_M, FRAME_SIGMA_M = 0.08, 0.025  # boards around a closed door, which stand out as the leaf does
ENDS_M = 0.05  # what only is a hole in a wall keeps off its ends and the ceiling
WINDOW_LOW_M = 0.3  # of a pane that is known by its brightness alone


class _Crossings(NamedTuple):
    """Rays that meet a wall's plane or end near it: metres along the side and above the floor.

    Attributes:
        pixel_m: what a pixel is wide at the plane.
        behind_m: how far behind the plane the ray ends; negative: before it.
        through: it ends behind the plane.
        on: it ends on the wall.
        before: it ends a door's thickness before it.
    """

    along: np.ndarray
    up: np.ndarray
    pixel_m: np.ndarray
    behind_m: np.ndarray
    through: np.ndarray
    on: np.ndarray
    before: np.ndarray
    bright: np.ndarray
    view: np.ndarray

    def of(self, which: np.ndarray) -> _Crossings:
        return _Crossings(*(part[which] for part in self))


def with_openings(plan: FloorPlan, rays: Rays, scale: float) -> FloorPlan:
    """The plan with the openings of its rooms' walls.

    Args:
        rays: in the plan's level frame.
        scale: relative deviation of the run's scale.
    """
    found: list[Opening] = []
    for number, room in enumerate(plan.rooms):
        for index, side in enumerate(room.sides):
            if side.wall is not None and side.length_m >= SMALLEST_M and _faces_in(plan, side):
                found += _of_side(plan, number, index, side, rays, scale)
    return replace(plan, openings=tuple(found))


def _faces_in(plan: FloorPlan, side: Side) -> bool:
    """Whether a side's wall is seen from its own room, which is on its left: the next room has its back."""
    along = side.end - side.start
    return bool(plan.walls[side.wall or 0].normal[:2] @ np.array([-along[1], along[0]]) > 0)


def _of_side(plan: FloorPlan, room: int, index: int, side: Side, rays: Rays, scale: float) -> Iterator[Opening]:
    top = plan.height_m or 2.6
    crossings = _crossings(plan, side, rays, top)
    shape = int(np.ceil(side.length_m / CELL_M)), int(np.ceil(top / CELL_M))
    wall_bright = float(np.median(crossings.bright[~crossings.through])) if (~crossings.through).any() else 0.5
    taken = np.zeros(shape, bool)
    shining = _shines(crossings, wall_bright)
    for says, closed in ((crossings.through, False), (crossings.before, True), (shining, False)):
        for low, high, fill in _rectangles(crossings, says, shape, taken):
            one = _opening(crossings, says, low, high, fill, closed, wall_bright, scale, side.length_m, top)
            if one is not None:
                i0, i1 = int(one.start_m / CELL_M), int(np.ceil(one.end_m / CELL_M))
                taken[i0:i1, int(one.low_m / CELL_M) : int(np.ceil(one.high_m / CELL_M))] = True
                yield replace(one, room=room, side=index)


def _shines(crossings: _Crossings, wall_bright: float) -> np.ndarray:
    """(R,) bool: rays that end on the wall in something as bright as a window's pane."""
    return ~crossings.through & (crossings.bright > max(BRIGHT, BRIGHTER * wall_bright))


def _crossings(plan: FloorPlan, side: Side, rays: Rays, top: float) -> _Crossings:
    wall = plan.walls[side.wall or 0]
    normal, along = wall.normal, np.append((side.end - side.start) / side.length_m, 0.0)
    origin, end = rays.origin @ normal - wall.offset_m, rays.end @ normal - wall.offset_m
    reach = np.maximum(BEFORE_M[1], np.minimum(rays.sigma_m, 0.15))
    seen = (origin > 0.2) & (end < reach)
    share = np.where(end < 0, origin / np.maximum(origin - end, 1e-9), 1.0)[seen]
    place = rays.origin[seen] + share[:, None] * (rays.end[seen] - rays.origin[seen])
    x, z = place @ along - np.append(side.start, 0) @ along, place[:, 2] - plan.floor.offset_m
    behind = -end[seen]
    on = (x >= 0) & (x <= side.length_m) & (z >= 0) & (z <= top)
    through = behind > np.maximum(THROUGH_M, 1.5 * rays.sigma_m[seen])
    before = (behind < -BEFORE_M[0]) & (behind > -BEFORE_M[1])
    wall_hit = np.abs(behind) < np.maximum(ON_WALL_M, np.minimum(rays.sigma_m[seen], THROUGH_M))
    pixel_m = rays.pixel[seen] * np.linalg.norm(place - rays.origin[seen], axis=1)
    return _Crossings(x, z, pixel_m, behind, through, wall_hit, before, rays.bright[seen], rays.view[seen]).of(on)


def _counts(crossings: _Crossings, which: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    edges = [np.arange(count + 1) * CELL_M for count in shape]
    return np.histogram2d(crossings.along[which], crossings.up[which], bins=edges)[0]


def _rectangles(
    crossings: _Crossings, says: np.ndarray, shape: tuple[int, int], taken: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Lowest and highest corner (2,), metres, of what stands out, and how much of it is filled."""
    yes, whole = _counts(crossings, says, shape), _counts(crossings, np.ones(len(says), bool), shape)
    near = np.ones((3, 3))
    yes, whole = ndimage.convolve(yes, near, mode="constant"), ndimage.convolve(whole, near, mode="constant")
    open_cells = (whole >= LEAST_RAYS) & (yes > OPEN_SHARE * whole) & ~taken
    unseen = whole < LEAST_RAYS
    cells, count = ndimage.label(ndimage.binary_opening(open_cells, np.ones((3, 3))))
    for label in range(1, count + 1):
        columns, rows = np.nonzero(cells == label)
        low = np.array([np.quantile(columns, 0.03), np.quantile(rows, 0.03)])
        high = np.array([np.quantile(columns, 0.97), np.quantile(rows, 0.97)]) + 1
        inside = np.s_[int(low[0]) : int(np.ceil(high[0])), int(low[1]) : int(np.ceil(high[1]))]
        known = ~unseen[inside]
        fill = float(open_cells[inside][known].mean()) if known.any() else 0.0
        if ((high - low) * CELL_M >= SMALLEST_M).all() and fill >= FILLED:
            yield low * CELL_M, high * CELL_M, fill


def _opening(
    crossings: _Crossings,
    says: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    fill: float,
    closed: bool,
    wall_bright: float,
    scale: float,
    length: float,
    top: float,
) -> Opening | None:
    inner = _inside(crossings, low, high)
    views = len(np.unique(crossings.view[inner & says]))
    if views < LEAST_VIEWS:
        return None
    told = says | (crossings.on & ~says)
    x, z, yes = crossings.along[told], crossings.up[told], says[told]
    (x0, sx0), (x1, sx1) = _edges(x, z, yes, low, high, length)
    (z0, sz0), (z1, sz1) = _edges(z, x, yes, low[::-1], high[::-1], top)
    z0, sz0 = (0.0, 0.0) if z0 < DOOR_LOW_M else (z0, sz0)
    width, height = x1 - x0, z1 - z0
    depth = float(np.median(crossings.behind_m[inner & says]))
    shines = float(np.median(crossings.bright[inner & says])) > max(BRIGHT, BRIGHTER * wall_bright)
    if depth > NICHE_M:
        fat = FATTENING_PX * float(np.median(crossings.pixel_m[inner & says]))
        x0, x1 = max(0.0, x0 - fat), min(length, x1 + fat)
        z0, z1 = max(0.0, z0 - fat), min(top, z1 + fat)
        sx0, sx1, sz1 = (float(np.hypot(sigma, fat / 2)) for sigma in (sx0, sx1, sz1))
        hidden = z0 < HIDDEN_LOW_M and z1 > DOOR_HIGH_M
        z0 = 0.0 if hidden or _reaches_the_floor(crossings, says, x0, x1, z0) else z0
    width, height = x1 - x0, z1 - z0
    kind = _kind(width, z0, z1, depth, shines, closed)
    at_end = min(x0, length - x1, top - z1) < ENDS_M
    if kind is None or min(width, height) < SMALLEST_M or (at_end and kind in ("window", "niche")):
        return None
    if closed:
        x0, x1, z1, width, height = x0 + FRAME_M, x1 - FRAME_M, z1 - FRAME_M, width - 2 * FRAME_M, height - FRAME_M
        sx0, sx1, sz1 = (float(np.hypot(sigma, FRAME_SIGMA_M)) for sigma in (sx0, sx1, sz1))
    share = float(says[inner].mean())
    probability = fill * share * (1 - 0.5**views) * (0.7 if closed else 1.0)
    return Opening(
        kind,
        closed,
        0,
        0,
        x0,
        x1,
        z0,
        z1,
        depth if 0 < depth < NICHE_M else None,
        probability,
        _size(width, sx0, sx1, scale),
        _size(height, sz0, sz1, scale),
    )


def _reaches_the_floor(crossings: _Crossings, says: np.ndarray, start: float, end: float, low: float) -> bool:
    """Whether nothing tells of a wall below an opening."""
    margin = 0.15 * (end - start)
    below = _inside(crossings, np.array([start + margin, 0.0]), np.array([end - margin, max(low, DOOR_LOW_M)]))
    wall, opened = (below & crossings.on & ~says).sum(), (below & says).sum()
    return bool(wall < LEAST_WALL_RAYS or opened > wall)


def _kind(width: float, low: float, high: float, depth: float, shines: bool, closed: bool) -> str | None:
    """What an opening is; None: nothing that has a name."""
    if closed:
        (least, most), (lowest, highest) = CLOSED_M
        return "door" if least <= width <= most and low == 0 and lowest <= high <= highest else None
    if shines and depth < NICHE_M:
        return "window" if low >= WINDOW_LOW_M or depth > THROUGH_M else None
    if low == 0 and high >= DOOR_HIGH_M and depth > NICHE_M:
        return "door" if width <= DOOR_WIDE_M else "passage"
    return "window" if depth > NICHE_M else "niche"


def _inside(crossings: _Crossings, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    along = (crossings.along > low[0]) & (crossings.along < high[0])
    return along & (crossings.up > low[1]) & (crossings.up < high[1])


def _size(value: float, one: float, other: float, scale: float) -> Length:
    return Length(
        value, 0.0, float(np.hypot(one, other)), scale * value, "edges between rays that end on and behind the wall"
    )


def _edges(
    place: np.ndarray, across: np.ndarray, says: np.ndarray, low: np.ndarray, high: np.ndarray, most: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where an opening begins and ends along one way, each with its deviation: where fewest rays contradict.

    Args:
        place, across: (R,) metres along that way and across it.
        low, high: (2,) rough bounds along it and across.
    """
    margin = 0.1 * (high[1] - low[1])
    band = (across > low[1] + margin) & (across < high[1] - margin)
    middle = (low[0] + high[0]) / 2
    ends = []
    for rough, inwards in ((low[0], 1.0), (high[0], -1.0)):
        near = band & (np.abs(place - rough) < EDGE_M) & ((place - middle) * inwards < 0.25 * (high[0] - low[0]))
        away, opened = (place[near] - rough) * inwards, says[near]
        at, sigma = _boundary(away, opened)
        ends.append((float(np.clip(rough + inwards * at, 0, most)), sigma))
    return ends[0], ends[1]


def _boundary(away: np.ndarray, opened: np.ndarray) -> tuple[float, float]:
    """The place from which on rays see an opening, and its deviation; 0 is the rough guess.

    At each place are counted the open rays outside and the others inside; the deviation is from the width over which
    that is hardly worse than at best.
    """
    if opened.all() or not opened.any():
        return 0.0, CELL_M
    grid = np.arange(-EDGE_M, EDGE_M, 0.005)
    outside = np.searchsorted(np.sort(away[opened]), grid)
    inside = (~opened).sum() - np.searchsorted(np.sort(away[~opened]), grid)
    wrong = outside + inside
    good = grid[wrong <= wrong.min() + np.sqrt(wrong.min() + 1)]
    at = float(np.mean(grid[wrong == wrong.min()]))
    return at, float(np.hypot(EDGE_SIGMA_M, np.ptp(good) / np.sqrt(12)))
