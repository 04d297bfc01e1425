"""The outline of a room: walls cut the plan into cells, and those above which floor or ceiling was seen are inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from room2dgs.errors import InputError
from room2dgs.lengths.length import Length
from room2dgs.plan.planes import Plane
from room2dgs.plan.surface import LevelSurface

LEVEL_M = 0.05  # from floor or ceiling, a face that is not upright is theirs
SEEN_SHARE = 0.5  # of a cell: inside
LEAST_CAMERAS, CAMERAS_SHARE = 2, 0.05  # of all cameras, that stood in a cell: inside
EDGE_SHARE = 0.001  # of what was seen lies beyond the box in which rooms are sought, on each side
MIN_ROOM_M2 = 1.0
COLUMN_M, COLUMN_SHARE = 0.1, 0.1  # of a line between two cells, and of a column's area, that is seen to be wall
WALLED, GAP_M = 0.45, 1.3  # so much of the line's length is wall, and no gap as wide, where it parts them
WALL_COS = 0.94  # of faces from their wall's normal
ON_WALL_M = 0.02
NEAR_EDGE_M = 0.3
NEAR_AXIS = 0.999  # cosine


@dataclass(frozen=True)
class Side:
    """One side of an outline, from corner to corner, the room on its left; level frame, metres.

    Attributes:
        wall: index of the wall that it lies on; None where none was found.
        measured: its length with its standard deviation; None: not measured (`with_sigmas`).
    """

    start: np.ndarray
    end: np.ndarray
    wall: int | None
    measured: Length | None = None

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(self.end - self.start))


@dataclass(frozen=True)
class Outline:
    """One room.

    Attributes:
        sides: around it, counter-clockwise.
        islands: what stands in it from floor to ceiling, each with its sides, clockwise.
        area_m2: of the floor.
    """

    sides: tuple[Side, ...]
    islands: tuple[tuple[Side, ...], ...]
    area_m2: float


def outlines(
    surface: LevelSurface, floor: Plane, ceiling: Plane | None, walls: Sequence[Plane], stood: np.ndarray
) -> list[Outline]:
    """Rooms, largest first.

    Args:
        stood: (N, 2) where cameras were, level frame; may be empty.

    Raises:
        InputError: no room came out.
    """
    import shapely

    seen = _seen(surface, floor, ceiling)
    places = np.concatenate([seen.below, seen.above])[:, :2]
    low = _edge(np.quantile(places, EDGE_SHARE, axis=0), walls, 1.0)
    high = _edge(np.quantile(places, 1 - EDGE_SHARE, axis=0), walls, -1.0)
    cut = [_across(wall, low, high) for wall in walls]
    lines = [shapely.LineString(ends) for ends in cut if ends is not None]
    whole = shapely.unary_union([shapely.box(*low, *high).exterior, *lines])
    cells = shapely.polygonize([whole]).geoms
    inside = [cell for cell in cells if seen.share(cell) >= SEEN_SHARE or _stood_in(cell, stood)]
    rooms = [room for room in _rooms(inside, surface, floor, ceiling, walls) if room.area >= MIN_ROOM_M2]
    if not rooms:
        raise InputError("no room came out of the mesh's floor and walls; film floor, ceiling and walls, or mesh again")
    rooms.sort(key=lambda room: -room.area)
    return [_outline(shapely.remove_repeated_points(room, 1e-4), walls) for room in rooms]


class _Seen(NamedTuple):
    """What was seen of floor and ceiling.

    Attributes:
        below: (N, 3) x, y and area of faces of the floor and of whatever stands on it and faces up.
        above: (M, 3) the same of the ceiling.
    """

    below: np.ndarray
    above: np.ndarray

    def share(self, cell) -> float:
        """Of a cell of the plan, by floor or ceiling, whichever was seen better."""
        return max(_area(cell, self.below), _area(cell, self.above)) / cell.area


def _seen(surface: LevelSurface, floor: Plane, ceiling: Plane | None) -> _Seen:
    """Rough faces of floor and ceiling face anywhere, so their height counts as well as their normal."""
    height, rows = surface.middle[:, 2], np.column_stack([surface.middle[:, :2], surface.area])
    level = ~surface.upright
    below = surface.upward | (level & (np.abs(height - floor.offset_m) < LEVEL_M))
    above = level & (np.abs(height + ceiling.offset_m) < LEVEL_M) if ceiling else surface.downward
    return _Seen(rows[below], rows[above])


def _rooms(cells: list, surface: LevelSurface, floor: Plane, ceiling: Plane | None, walls: Sequence[Plane]) -> list:
    """Cells joined with their neighbours, where no wall was seen between them; the line of a wall goes on beyond it."""
    import shapely
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    top = -ceiling.offset_m if ceiling else float(np.quantile(surface.middle[:, 2], 0.995))
    pairs = []
    for one, other in shapely.STRtree(cells).query(cells, predicate="touches").T if cells else ():
        edge = shapely.intersection(cells[one], cells[other])
        if one < other and edge.length > 1e-6 and not _walled(edge, surface, walls, top - floor.offset_m):
            pairs.append((one, other))
    row, column = np.array(pairs, np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(row)), (row, column)), shape=(len(cells), len(cells)))
    count, label = connected_components(graph, directed=False)
    groups = ([cell for cell, part in zip(cells, label, strict=True) if part == number] for number in range(count))
    joined = (shapely.union_all(group, grid_size=1e-6) for group in groups)
    return [part for one in joined for part in getattr(one, "geoms", [one])]


def _walled(edge, surface: LevelSurface, walls: Sequence[Plane], height_m: float) -> bool:
    """Whether a wall was seen along an edge between two cells, with no gap wider than a door; above a door is wall."""
    start, end = np.array(edge.coords[0]), np.array(edge.coords[-1])  # cells are convex
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    columns = max(1, round(length / COLUMN_M))
    seen = np.zeros(columns)
    for wall in walls:
        across = wall.normal[:2]
        if abs(across @ along) > np.sin(np.radians(1)) or abs(start @ across - wall.offset_m) > ON_WALL_M:
            continue
        on = surface.upright & (surface.normal[:, :2] @ across > WALL_COS)
        on &= np.abs(surface.middle[:, :2] @ across - wall.offset_m) < LEVEL_M
        place = (surface.middle[on][:, :2] - start) @ along / length
        inside = (place > 0) & (place < 1)
        seen += np.bincount((place[inside] * columns).astype(np.int64), surface.area[on][inside], columns)
    wall_m = length / columns
    there = np.flatnonzero(seen > COLUMN_SHARE * height_m * wall_m)
    gaps = np.diff(np.concatenate([[-1], there, [columns]])) - 1
    return bool(len(there) * wall_m > WALLED * length and gaps.max() * wall_m < GAP_M)


def _stood_in(cell, stood: np.ndarray) -> bool:
    """Whether cameras were there: then it is inside, however little of floor and ceiling they saw."""
    import shapely

    many = int(shapely.contains_xy(cell, stood).sum()) if len(stood) else 0
    return many >= max(LEAST_CAMERAS, CAMERAS_SHARE * len(stood))


def _area(cell, rows: np.ndarray) -> float:
    import shapely

    (x0, y0, x1, y1) = cell.bounds
    near = rows[((rows[:, :2] >= (x0, y0)) & (rows[:, :2] <= (x1, y1))).all(axis=1)]
    return float(near[shapely.contains_xy(cell, near[:, :2]), 2].sum())


def _edge(corner: np.ndarray, walls: Sequence[Plane], sign: float) -> np.ndarray:
    """(2,) lowest (sign 1) or highest (-1) corner of the box in which rooms are sought.

    It lies on a wall that is near: floor and ceiling are not always seen up to it, and rough ones reach beyond it.
    """
    moved = corner.copy()
    for axis in (0, 1):
        places = [wall.normal[axis] * wall.offset_m for wall in walls if sign * wall.normal[axis] > NEAR_AXIS]
        near = [place for place in places if abs(place - corner[axis]) < NEAR_EDGE_M]
        if near:
            moved[axis] = min(near) if sign > 0 else max(near)
    return moved


def _across(wall: Plane, low: np.ndarray, high: np.ndarray) -> np.ndarray | None:
    """(2, 2) ends of the wall's line, far beyond the box; None if it does not meet the box."""
    normal, along = wall.normal[:2], np.array([-wall.normal[1], wall.normal[0]])
    corners = np.array([low, high, (low[0], high[1]), (high[0], low[1])]) @ normal
    if not corners.min() <= wall.offset_m <= corners.max():
        return None
    reach = float(np.linalg.norm(high - low))
    middle = normal * wall.offset_m + along * (along @ (low + high) / 2)
    return np.stack([middle - reach * along, middle + reach * along])


def _outline(room, walls: Sequence[Plane]) -> Outline:
    rings = [np.asarray(ring.coords)[:-1] for ring in (room.exterior, *room.interiors)]
    wanted = [True, *([False] * (len(rings) - 1))]
    sides = [_sides(_corners(_turned(ring, left)), walls) for ring, left in zip(rings, wanted, strict=True)]
    return Outline(sides[0], tuple(sides[1:]), float(room.area))


def _turned(ring: np.ndarray, counter_clockwise: bool) -> np.ndarray:
    x, y = ring.T
    doubled = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return ring if (doubled > 0) == counter_clockwise else ring[::-1]


def _corners(ring: np.ndarray) -> np.ndarray:
    """Without points on a straight side."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    bends = np.abs(cross) > 1e-4 * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return ring[bends]


def _sides(ring: np.ndarray, walls: Sequence[Plane]) -> tuple[Side, ...]:
    found = []
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        ends = np.stack([start, end])
        off = [np.abs(ends @ wall.normal[:2] - wall.offset_m).max() for wall in walls]
        nearest = int(np.argmin(off)) if off else None
        found.append(Side(start, end, nearest if nearest is not None and off[nearest] < ON_WALL_M else None))
    return tuple(found)
