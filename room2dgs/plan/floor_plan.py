"""A mesh to its floor plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh

from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.lengths.length import Length, with_sigma
from room2dgs.plan.low_walls import LowWall, low_walls
from room2dgs.plan.opening import Opening
from room2dgs.plan.outline import Outline, Side, outlines
from room2dgs.plan.planes import Plane, level_planes, upright_planes, wall_planes
from room2dgs.plan.surface import heading, level_surface, turned_about_up

LEAST_SPREAD_M = 0.002


@dataclass(frozen=True)
class FloorPlan:
    """Rooms and their planes, in a level frame.

    Attributes:
        level_from_world: (3, 3) rotation; x and y across the floor, z up.
        floor, ceiling: None for a ceiling that was not seen.
        walls: wall_1, wall_2, ... in the order of the rooms' sides; `Side.wall` counts them from 0.
        rooms: largest first.
        height: from floor to ceiling, with its standard deviation; None: no ceiling, or not measured (`with_sigmas`).
        unit: of lengths: "m", or "units" where the scale of the capture is unknown.
        openings: doors, windows, passages and niches; none where the run does not say what its views see.
        low_walls: that end far below the ceiling.
    """

    level_from_world: np.ndarray
    floor: Plane
    ceiling: Plane | None
    walls: tuple[Plane, ...]
    rooms: tuple[Outline, ...]
    height: Length | None = None
    unit: str = "m"
    openings: tuple[Opening, ...] = ()
    low_walls: tuple[LowWall, ...] = ()

    @property
    def height_m(self) -> float | None:
        """From floor to ceiling."""
        return None if self.ceiling is None else -self.ceiling.offset_m - self.floor.offset_m

    @property
    def planes(self) -> tuple[Plane, ...]:
        return (self.floor, *((self.ceiling,) if self.ceiling else ()), *self.walls)

    def wall_name(self, side: Side) -> str:
        """The wall on which a side lies, or "open"."""
        return "open" if side.wall is None else self.walls[side.wall].name


def floor_plan(mesh: trimesh.Trimesh, up: np.ndarray, stood: np.ndarray | None = None) -> FloorPlan:
    """Planes and outline of the rooms in a mesh.

    Args:
        mesh: world frame, metres; its faces wind counter-clockwise seen from inside.
        up: (3,) unit, world.
        stood: (N, 3) where cameras were, world: that is inside a room. None: unknown.

    Raises:
        InputError: no floor, or no room.
    """
    surface = level_surface(mesh, up)
    floor, ceiling = level_planes(surface)
    first = wall_planes(surface, floor, ceiling, upright_planes(surface, snap=False))
    # The planes know the heading better than single faces, whose normals are rough: a line of length l that is uneven
    # by s tells its direction with a variance of s^2 / (area l^2), and all walls are about as high.
    normals = np.stack([wall.normal[:2] for wall in first]) if first else np.zeros((0, 2))
    sure = np.array([wall.area_m2**3 / (wall.spread_m + LEAST_SPREAD_M) ** 2 for wall in first])
    surface = turned_about_up(surface, heading(normals, sure))
    planes = upright_planes(surface)
    found = wall_planes(surface, floor, ceiling, planes)
    inside = np.zeros((0, 2)) if stood is None else (stood @ surface.level_from_world.T)[:, :2]
    rooms = outlines(surface, floor, ceiling, found, inside)
    used = list(dict.fromkeys(side.wall for room in rooms for side in _sides(room) if side.wall is not None))
    walls = tuple(replace(found[index], name=f"wall_{number}") for number, index in enumerate(used, start=1))
    number = {index: place for place, index in enumerate(used)}
    rooms = [_renumbered(room, number) for room in rooms]
    low = low_walls(surface, floor, planes)
    return FloorPlan(surface.level_from_world, floor, ceiling, walls, tuple(rooms), low_walls=low)


def plan_in_world(plan: FloorPlan, origin_m: Origin) -> FloorPlan:
    """The plan of a mesh in a scene's frame, in the capture's world: its level frame is that world's, turned.

    Args:
        origin_m: `Scene.origin_m`.
    """
    if origin_m == AT_ORIGIN:
        return plan
    by = plan.level_from_world @ np.array(origin_m)

    def plane(one: Plane) -> Plane:
        offset_m, up_m = float(one.normal @ by), float(by[2])
        return replace(one, offset_m=one.offset_m + offset_m, low_m=one.low_m + up_m, high_m=one.high_m + up_m)

    def ring(sides: tuple[Side, ...]) -> tuple[Side, ...]:
        return tuple(replace(side, start=side.start + by[:2], end=side.end + by[:2]) for side in sides)

    return replace(
        plan,
        floor=plane(plan.floor),
        ceiling=plan.ceiling and plane(plan.ceiling),
        walls=tuple(plane(wall) for wall in plan.walls),
        low_walls=tuple(
            replace(
                wall,
                start=wall.start + by[:2],
                end=wall.end + by[:2],
                faces=(plane(wall.faces[0]), plane(wall.faces[1])),
            )
            for wall in plan.low_walls
        ),
        rooms=tuple(
            replace(room, sides=ring(room.sides), islands=tuple(ring(island) for island in room.islands))
            for room in plan.rooms
        ),
    )


def sentences(plan: FloorPlan) -> list[str]:
    """The plan in a few lines."""
    height = (
        "no level ceiling was seen"
        if plan.height_m is None
        else f"height {_text(plan.height, plan.height_m, plan.unit)}"
    )
    lines = []
    for number, room in enumerate(plan.rooms, start=1):
        lengths = " x ".join(_text(side.measured, side.length_m, plan.unit) for side in room.sides)
        opened = sum(side.wall is None for side in room.sides)
        more = f"; {opened} of {len(room.sides)} sides have no wall" if opened else ""
        lines.append(f"room {number}: {room.area_m2:.2f} {plan.unit}², {height}, sides {lengths}{more}")
    for one in plan.openings:
        wall = plan.wall_name(plan.rooms[one.room].sides[one.side])
        shut = "closed " if one.closed else ""
        lines.append(
            f"{shut}{one.kind} in {wall}: {one.width.text(plan.unit)} wide, {one.height.text(plan.unit)} high, "
            f"{one.low_m:.2f} m over the floor, probability {one.probability:.2f}"
        )
    lines += [
        f"low wall: {_text(one.thickness, one.thick_m, plan.unit)} thick, {one.length_m:.2f} {plan.unit} long, "
        f"{one.high_m:.2f} {plan.unit} high"
        for one in plan.low_walls
    ]
    lines += [
        f"{one.name}: {one.area_m2:.1f} {plan.unit}² seen, {one.spread_m * 1000:.1f} mm uneven" for one in plan.planes
    ]
    return lines


def _text(measured: Length | None, length_m: float, unit: str) -> str:
    """With its standard deviation where that is known."""
    return f"{length_m:.3f} m" if measured is None else with_sigma(measured.value, measured.sigma, unit)


def as_json(plan: FloorPlan) -> dict[str, Any]:
    """Plain values; planes in the capture's world: normal @ point = offset_m."""
    return {
        "level_from_world": plan.level_from_world.tolist(),
        "height_m": plan.height_m,
        **({} if plan.height is None else {"height": plan.height.as_dict(plan.unit)}),
        "planes": [
            {
                "name": one.name,
                "normal": (one.normal @ plan.level_from_world).tolist(),
                "offset_m": one.offset_m,
                "area_m2": one.area_m2,
                "spread_m": one.spread_m,
                "low_m": one.low_m - plan.floor.offset_m,
                "high_m": one.high_m - plan.floor.offset_m,
            }
            for one in plan.planes
        ],
        "rooms": [
            {
                "area_m2": room.area_m2,
                "sides": [
                    {**_side(plan, side), **_openings(plan, number, index)} for index, side in enumerate(room.sides)
                ],
                "islands": [[_side(plan, side) for side in island] for island in room.islands],
            }
            for number, room in enumerate(plan.rooms)
        ],
        "low_walls": [one.as_dict(plan.unit) for one in plan.low_walls],
    }


def _openings(plan: FloorPlan, room: int, side: int) -> dict[str, Any]:
    found = [one.as_dict(plan.unit) for one in plan.openings if (one.room, one.side) == (room, side)]
    return {"openings": found} if found else {}


def _side(plan: FloorPlan, side: Side) -> dict[str, Any]:
    return {
        "start": side.start.tolist(),
        "end": side.end.tolist(),
        "length_m": side.length_m,
        "wall": plan.wall_name(side),
        **({} if side.measured is None else {"length": side.measured.as_dict(plan.unit)}),
    }


def _sides(room: Outline) -> tuple[Side, ...]:
    return (*room.sides, *(side for island in room.islands for side in island))


def _renumbered(room: Outline, number: dict[int, int]) -> Outline:
    def new(sides: tuple[Side, ...]) -> tuple[Side, ...]:
        return tuple(replace(side, wall=None if side.wall is None else number[side.wall]) for side in sides)

    return replace(room, sides=new(room.sides), islands=tuple(new(island) for island in room.islands))
