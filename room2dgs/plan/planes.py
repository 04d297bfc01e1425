"""Floor, ceiling and walls found in a mesh, each with how well it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from room2dgs.errors import InputError
from room2dgs.geometry.weighted_quantile import weighted_quantile
from room2dgs.plan.surface import LevelSurface

BIN_M = 0.01
SMOOTH = 5  # bins
PEAK_SHARE = 0.3  # of the largest level surface's area: what a floor or ceiling has at least
BAND_M = 0.04  # faces that close to a plane are its own
LOWEST_ROOM_M = 1.5
TALL = 0.8  # of the room's height: what a wall reaches, and furniture mostly does not
BEFORE_WALL_M = 0.4  # in front of a larger wall stand curtains and wardrobes
TALLER = 0.9  # of the room's height: what a pillar or a chimney reaches there, and they mostly do not
LOWEST_WALL_M = 1.5  # over the floor: what a wall is seen up to at least
BEHIND_M = 0.12, 0.7  # behind a plane: where wall or ceiling is seen if it is furniture's
OWN_M2, BEHIND_M2 = 0.02, 0.06  # of a column of it, 20 cm wide, and behind that: what was seen
MIN_WALL_M2 = 0.5
SLANTED_SHARE = 0.2  # of the floor's area: what slanted ceilings have at least
LOWEST_SLANT_M = 0.9  # over the floor: lower down things stand that lean
ROOF_NEAR_M, ROOF_COLUMN_M = 0.3, 0.2  # before a wall, and along it: where its height and the ceiling's are compared
ANGLE_BINS = 180
ANGLE_DEG = 10.0
OFFSET_M = 0.03
SQUARE_DEG = 6.0  # walls that nearly stand at right angles to the others are taken to do so
PARALLEL_DEG = 3.0  # between parallel walls
MODE_BIN_M, MODE_SMOOTH = 0.005, 3  # offsets of one wall's faces are counted in such bins, smoothed over so many
MODE_REACH_M = 0.08  # doors, boards and mouldings stand so far before their wall
MODE_SHARE = 0.15  # of the fullest: how full the outermost level is at least
MODE_DIP = 0.8  # of a level: how much emptier it is between it and the next
MODE_M2 = 0.3  # of an outermost level, at least
MODE_BAND_M = 0.02  # faces so near to it are the wall's own
SAME_M = 0.07  # parallel walls closer than this are one
MAX_PLANES = 80


@dataclass(frozen=True)
class Plane:
    """A plane, in the level frame.

    Attributes:
        name: floor, ceiling, wall_1, ...
        normal: (3,) unit, into the room.
        offset_m: normal @ point of its points.
        area_m2: of the faces that lie on it.
        spread_m: root mean square of their distances from it.
        low_m, high_m: heights between which it was seen (5th and 95th percentile).
    """

    name: str
    normal: np.ndarray
    offset_m: float
    area_m2: float
    spread_m: float
    low_m: float
    high_m: float


def level_planes(surface: LevelSurface) -> tuple[Plane, Plane | None]:
    """Floor, and ceiling if it was seen.

    Raises:
        InputError: nothing level faces up.
    """
    floor = _level(surface, surface.upward, "floor", lowest=True)
    if floor is None:
        raise InputError("no floor was found in the mesh; give up=z (or x, y, -z, ...), or film the floor too")
    above = surface.downward & (surface.middle[:, 2] > floor.offset_m + LOWEST_ROOM_M)
    ceiling = _level(surface, above, "ceiling", lowest=False)
    slanted = float(surface.area[_slanted(surface, floor)].sum())
    level = 0.0 if ceiling is None else ceiling.area_m2
    return floor, ceiling if slanted < max(SLANTED_SHARE * floor.area_m2, level) else None


def _slanted(surface: LevelSurface, floor: Plane) -> np.ndarray:
    """(F,) bool: faces of slanted ceilings, above what furniture has."""
    return surface.overhanging & (surface.middle[:, 2] > floor.offset_m + LOWEST_SLANT_M)


@dataclass(frozen=True)
class UprightPlane:
    """A wall, or something else that is flat and upright.

    Attributes:
        faces: (K,) numbers of the surface's faces that lie on it.
    """

    plane: Plane
    faces: np.ndarray


def upright_planes(surface: LevelSurface, snap: bool = True) -> list[UprightPlane]:
    """Upright planes, roughly the largest first; not named.

    Args:
        snap: those that nearly lie along x or y do so.
    """
    upright = np.flatnonzero(surface.upright)
    normal = surface.normal[upright, :2]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    place, area = surface.middle[upright], surface.area[upright]
    faces = _Upright(normal, place, area, surface.weight[upright])
    left = np.ones(len(upright), bool)
    found: list[UprightPlane] = []
    for _ in range(MAX_PLANES):
        start = _largest(normal[left], place[left], area[left])
        if start is None:
            break
        direction, offset, on = _fitted(faces, left, *start, snap)
        near = _near(normal, place, direction, offset, 2 * ANGLE_DEG, 1.5 * BAND_M)
        left &= ~(near | on)
        if area[on].sum() < MIN_WALL_M2:
            if area[on].sum() < MIN_WALL_M2 / 4:
                break
            continue
        low, high = (weighted_quantile(place[on, 2], area[on], share) for share in (0.05, 0.95))
        spread = float(np.sqrt(np.average((place[on, :2] @ direction - offset) ** 2, weights=area[on])))
        plane = Plane("", np.append(direction, 0.0), offset, float(area[on].sum()), spread, low, high)
        found.append(UprightPlane(plane, upright[on]))
    return found


def wall_planes(
    surface: LevelSurface, floor: Plane, ceiling: Plane | None, planes: Sequence[UprightPlane]
) -> list[Plane]:
    """Those of the upright planes that reach high enough, largest first; not yet named."""
    top = -ceiling.offset_m if ceiling else float(np.quantile(surface.middle[:, 2], 0.995))
    tall = floor.offset_m + TALL * (top - floor.offset_m)
    slanted = ceiling is None and surface.area[_slanted(surface, floor)].sum() > SLANTED_SHARE * floor.area_m2
    roof = _slanted(surface, floor) & slanted
    found: list[Plane] = []
    for one in planes:
        plane, direction = one.plane, one.plane.normal[:2]
        place, area = surface.middle[one.faces], surface.area[one.faces]
        meets = roof.any() and _meets(place, direction, surface.middle[roof], floor.offset_m)
        seen_up = plane.high_m >= floor.offset_m + LOWEST_WALL_M
        if plane.high_m >= tall or meets or (seen_up and _last(place, area, direction, plane.offset_m, surface)):
            found.append(plane)
    return _without_hangings(_distinct(found), tall, floor.offset_m + TALLER * (top - floor.offset_m))


def _level(surface: LevelSurface, which: np.ndarray, name: str, lowest: bool) -> Plane | None:
    height, area, weight = surface.middle[which, 2], surface.area[which], surface.weight[which]
    if not len(height):
        return None
    start = height.min()
    count = np.bincount(((height - start) / BIN_M).astype(int), area)
    smooth = np.convolve(count, np.ones(SMOOTH), "same")
    high = np.flatnonzero(smooth >= PEAK_SHARE * smooth.max())
    chosen = high[0] if lowest else high[-1]
    nearby = np.arange(max(0, chosen - 2 * SMOOTH), min(len(smooth), chosen + 2 * SMOOTH + 1))
    level = start + (nearby[smooth[nearby].argmax()] + 0.5) * BIN_M
    for _ in range(3):
        on = np.abs(height - level) < BAND_M
        level = weighted_quantile(height[on], weight[on], 0.5)
    spread = float(np.sqrt(np.average((height[on] - level) ** 2, weights=area[on])))
    sign = 1.0 if lowest else -1.0
    return Plane(name, np.array([0, 0, sign]), sign * level, float(area[on].sum()), spread, level, level)


def _meets(place: np.ndarray, direction: np.ndarray, roof: np.ndarray, floor_m: float) -> bool:
    """Whether a wall rises to the slanted ceiling before it, along most of what was seen of both.

    Args:
        place: (N, 3) of the wall's faces; direction: (2,) of its normal.
        roof: (M, 3) of the ceiling's faces.
    """
    away = roof[:, :2] @ direction - np.median(place[:, :2] @ direction)
    near = roof[(away > -BAND_M) & (away < ROOF_NEAR_M)]
    along = np.array([-direction[1], direction[0]])
    start = (place[:, :2] @ along).min()
    column, above = (np.floor((one[:, :2] @ along - start) / ROOF_COLUMN_M).astype(np.int64) for one in (place, near))
    count = int(column.max()) + 1
    beside = (above >= 0) & (above < count)
    above, near = above[beside], near[beside]
    top, ceiling = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(top, column, place[:, 2] - floor_m)
    np.minimum.at(ceiling, above, near[:, 2] - floor_m)
    known = np.isfinite(top) & np.isfinite(ceiling)
    return bool(known.any() and (top[known] >= TALL * ceiling[known]).mean() > 0.5 and known.mean() > 0.3)


def _last(place: np.ndarray, area: np.ndarray, direction: np.ndarray, offset: float, surface: LevelSurface) -> bool:
    """Whether nothing was seen behind most of a plane whose top was not filmed; behind furniture is wall or ceiling.

    Args:
        place, area: (N, 3), (N,) of the plane's faces; direction: (2,) of its normal.
    """
    behind = offset - surface.middle[:, :2] @ direction
    near = (behind > BEHIND_M[0]) & (behind < BEHIND_M[1])
    along = np.array([-direction[1], direction[0]])
    start = (place[:, :2] @ along).min()
    own, other = (((one[:, :2] @ along - start) / ROOF_COLUMN_M) for one in (place, surface.middle[near]))
    columns = int(own.max()) + 1
    here = np.bincount(own.astype(np.int64), area, columns)
    beside = (other >= 0) & (other < columns)
    there = np.bincount(other[beside].astype(np.int64), surface.area[near][beside], columns)
    full = here > OWN_M2
    return bool(full.any() and (there[full] > BEHIND_M2).mean() < 0.5)


def _largest(normal: np.ndarray, place: np.ndarray, area: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Direction and offset under which most of the area lies, by counting in bins of both."""
    if not len(normal):
        return None
    bins = np.round(np.arctan2(normal[:, 1], normal[:, 0]) / (2 * np.pi) * ANGLE_BINS).astype(int) % ANGLE_BINS
    angle = np.arange(ANGLE_BINS) / ANGLE_BINS * 2 * np.pi
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # of the bin's own direction: faces of one wall that fall into neighbouring bins are gathered by the fit
    offset = np.einsum("ni,ni->n", place[:, :2], directions[bins])
    start = offset.min()
    cell = ((offset - start) / OFFSET_M).astype(int)
    counts = np.bincount(bins * (cell.max() + 1) + cell, area, ANGLE_BINS * (cell.max() + 1))
    best = int(counts.argmax())
    if counts[best] <= 0:
        return None
    which, where = divmod(best, int(cell.max()) + 1)
    return directions[which], float(start + (where + 0.5) * OFFSET_M)


class _Upright(NamedTuple):
    """Faces that may be walls', N of them: normals (N, 2), places (N, 3), areas (N,), weights (N,)."""

    normal: np.ndarray
    place: np.ndarray
    area: np.ndarray
    weight: np.ndarray


def _fitted(
    faces: _Upright, left: np.ndarray, direction: np.ndarray, offset: float, snap: bool
) -> tuple[np.ndarray, float, np.ndarray]:
    """Direction (2,), offset and faces of the plane that is nearest to a first guess."""
    normal, place, area, weight = faces
    on = left
    for band in (2 * BAND_M, BAND_M, BAND_M):
        on = left & _near(normal, place, direction, offset, ANGLE_DEG, band)
        if not on.any():
            break
        direction = _line(place[on, :2], area[on], direction)
        direction = _snapped(direction) if snap else direction
        offset = weighted_quantile(place[on, :2] @ direction, weight[on], 0.5)
    return _outermost(faces, left, direction, offset, snap, on)


def _outermost(
    faces: _Upright, left: np.ndarray, direction: np.ndarray, offset: float, snap: bool, on: np.ndarray
) -> tuple[np.ndarray, float, np.ndarray]:
    """The wall behind what is fixed on it: of the levels near a plane the outermost that is about as full as another.

    A closed door stands 4 cm before its wall, and the median of both is neither.
    """
    if not on.any():
        return direction, offset, on
    normal, place, area, weight = faces
    near = np.flatnonzero(left & _near(normal, place, direction, offset, ANGLE_DEG, MODE_REACH_M))
    level = offset + _lowest_mode(place[near, :2] @ direction - offset, area[near])
    for _ in range(3):
        own = left & _near(normal, place, direction, level, ANGLE_DEG, MODE_BAND_M)
        if not own.any():
            return direction, offset, on
        direction = direction if snap else _line(place[own, :2], area[own], direction)
        level = weighted_quantile(place[own, :2] @ direction, weight[own], 0.5)
    return direction, level, on


def _lowest_mode(away: np.ndarray, area: np.ndarray) -> float:
    """The lowest level about which much of the area lies, apart from the next.

    Args:
        away: metres, within `MODE_REACH_M` of 0.
    """
    count = np.bincount(((away + MODE_REACH_M) / MODE_BIN_M).astype(int), area)
    smooth = np.convolve(np.pad(count, MODE_SMOOTH), np.ones(MODE_SMOOTH), "same")
    peaks = np.flatnonzero((smooth[1:-1] >= smooth[:-2]) & (smooth[1:-1] > smooth[2:])) + 1
    fullest = int(peaks[smooth[peaks].argmax()])
    chosen = fullest
    for peak in peaks[peaks < fullest]:
        dip = smooth[peak:fullest].min()
        full = smooth[peak] >= max(MODE_SHARE * smooth[fullest], MODE_M2)
        if full and dip <= MODE_DIP * smooth[peak]:
            chosen = int(peak)
            break
    return (chosen - MODE_SMOOTH + 0.5) * MODE_BIN_M - MODE_REACH_M


def _near(
    normal: np.ndarray, place: np.ndarray, direction: np.ndarray, offset: float, angle_deg: float, band_m: float
) -> np.ndarray:
    return (normal @ direction > np.cos(np.radians(angle_deg))) & (np.abs(place[:, :2] @ direction - offset) < band_m)


def _line(place: np.ndarray, weight: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(2,) unit normal of the line through points in the plan, on the side of `direction`."""
    off = place - np.average(place, axis=0, weights=weight)
    found = np.linalg.eigh((off * weight[:, None]).T @ off)[1][:, 0]
    # a narrow strip has no direction of its own
    if abs(found @ direction) < np.cos(np.radians(ANGLE_DEG)):
        return direction
    return found if found @ direction > 0 else -found


def _snapped(direction: np.ndarray) -> np.ndarray:
    axis = np.zeros(2)
    axis[np.abs(direction).argmax()] = np.sign(direction[np.abs(direction).argmax()])
    return axis if direction @ axis > np.cos(np.radians(SQUARE_DEG)) else direction


def _distinct(planes: list[Plane]) -> list[Plane]:
    """Largest first, without those that repeat a larger one."""
    kept: list[Plane] = []
    for one in sorted(planes, key=lambda plane: -plane.area_m2):
        if not any(
            one.normal @ other.normal > np.cos(np.radians(PARALLEL_DEG)) and abs(one.offset_m - other.offset_m) < SAME_M
            for other in kept
        ):
            kept.append(one)
    return kept


def _without_hangings(planes: list[Plane], tall: float, taller: float) -> list[Plane]:
    """Without what hangs or stands close before a larger wall and ends below `taller`; below `tall`, before any."""

    def hides(one: Plane, other: Plane) -> bool:
        low = one.high_m < tall
        behind = one.offset_m - other.offset_m
        alike = one.normal @ other.normal > np.cos(np.radians(PARALLEL_DEG))
        return bool(
            alike and 0 < behind < (BEHIND_M[1] if low else BEFORE_WALL_M) and (low or other.area_m2 > one.area_m2)
        )

    return [one for one in planes if one.high_m >= taller or not any(hides(one, other) for other in planes)]
