"""Standard deviations of a plan's lengths: of the planes that they lie between, and of the scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from room2dgs.lengths.length import Length
from room2dgs.lengths.plane_sigma import UNKNOWN, Faces, PlaneSigma, plane_sigma
from room2dgs.lengths.scale import ScaleTrust
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.low_walls import LowWall
from room2dgs.plan.outline import Outline, Side
from room2dgs.plan.planes import Plane

LEAST_SINE = 0.1  # of the angle between a side and the next: flatter corners are nowhere


class Area(NamedTuple):
    """Square metres with their standard deviation."""

    value: float
    sigma: float


def with_sigmas(plan: FloorPlan, faces: Faces, scale: ScaleTrust) -> FloorPlan:
    """The plan with all lengths measured.

    Args:
        plan: in its level frame, as `floor_plan` gives it.
        faces: of the mesh that it was made of, world.
        scale: of the run.
    """
    turn = plan.level_from_world.T
    level = Faces(faces.middle @ turn, faces.normal @ turn, faces.area, faces.sigma_m)
    walls = [plane_sigma(level, wall.normal, wall.offset_m) for wall in plan.walls]
    rooms = tuple(_measured(room, plan.walls, walls, scale.sigma) for room in plan.rooms)
    low = tuple(_with_thickness(wall, level, scale.sigma) for wall in plan.low_walls)
    return replace(plan, rooms=rooms, low_walls=low, height=_height(plan, level, scale.sigma), unit=scale.unit)


def room_area(room: Outline, scale: float) -> Area:
    """Of the floor: each side moves by the deviation of its wall, as much of the area as it is long.

    The deviation of a side's wall is taken from the lengths of the sides next to it, which end on it.

    Args:
        scale: relative deviation of the run's scale.
    """
    sides = room.sides
    parts = []
    for before, side in zip((sides[-1], *sides[:-1]), sides, strict=True):
        own = 0.0 if before.measured is None else float(np.hypot(before.measured.surface_m, before.measured.fit_m))
        parts.append(side.length_m * own / np.sqrt(2))  # a length has two ends
    return Area(room.area_m2, float(np.hypot(np.linalg.norm(parts), 2 * scale * room.area_m2)))


def _with_thickness(wall: LowWall, level: Faces, scale: float) -> LowWall:
    one, other = (plane_sigma(level, face.normal, face.offset_m) for face in wall.faces)
    return replace(wall, thickness=_between(wall.thick_m, (one, 1.0), (other, 1.0), scale, "its two faces"))


def _height(plan: FloorPlan, level: Faces, scale: float) -> Length | None:
    if plan.ceiling is None or plan.height_m is None:
        return None
    floor, ceiling = (plane_sigma(level, one.normal, one.offset_m) for one in (plan.floor, plan.ceiling))
    return _between(plan.height_m, (floor, 1.0), (ceiling, 1.0), scale, "floor and ceiling")


def _measured(room: Outline, walls: Sequence[Plane], sigmas: Sequence[PlaneSigma], scale: float) -> Outline:
    def ring(sides: tuple[Side, ...]) -> tuple[Side, ...]:
        before, after = (sides[-1], *sides[:-1]), (*sides[1:], sides[0])
        threes = zip(before, sides, after, strict=True)
        return tuple(replace(three[1], measured=length(*three)) for three in threes)

    def length(before: Side, side: Side, after: Side) -> Length:
        along = (side.end - side.start) / side.length_m
        first, last = (_end(one, along, walls, sigmas) for one in (before, after))
        names = " and ".join("an open side" if one.wall is None else walls[one.wall].name for one in (before, after))
        return _between(side.length_m, first, last, scale, names)

    return replace(room, sides=ring(room.sides), islands=tuple(map(ring, room.islands)))


def _end(
    side: Side, along: np.ndarray, walls: Sequence[Plane], sigmas: Sequence[PlaneSigma]
) -> tuple[PlaneSigma, float]:
    """The plane on which a side ends, and the sine of the angle at which they meet."""
    if side.wall is None:
        return UNKNOWN, 1.0
    return sigmas[side.wall], max(LEAST_SINE, abs(float(walls[side.wall].normal[:2] @ along)))


def _between(
    value: float, one: tuple[PlaneSigma, float], other: tuple[PlaneSigma, float], scale: float, names: str
) -> Length:
    surface = np.hypot(one[0].surface_m / one[1], other[0].surface_m / other[1])
    fit = np.hypot(one[0].fit_m / one[1], other[0].fit_m / other[1])
    areas = f"{one[0].area_m2:.1f} and {other[0].area_m2:.1f} m² of the mesh"
    return Length(value, float(surface), float(fit), scale * value, f"{names} ({areas})")
