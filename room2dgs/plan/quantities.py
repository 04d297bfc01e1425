"""Areas, volume and clearances of a plan."""

from __future__ import annotations

from typing import Any

import numpy as np

from room2dgs.lengths.scale import ScaleTrust
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.sigmas import room_area


def quantities(plan: FloorPlan, scale: ScaleTrust) -> dict[str, Any]:
    """Of each room: floor, walls gross and net of doors, windows and passages, volume; and what can be passed.

    Areas and volumes have one standard deviation; those of a room whose ceiling was not seen are null.
    """
    return {
        "rooms": [_room(plan, number, scale.sigma) for number in range(len(plan.rooms))],
        "clearances": clearances(plan),
    }


def clearances(plan: FloorPlan) -> list[dict[str, Any]]:
    """Free width and height of doors and passages, by which people see what a chair or a bed passes."""
    passed = [one for one in plan.openings if one.kind in ("door", "passage")]
    return [
        {
            "what": f"{one.kind} {number}, {plan.wall_name(plan.rooms[one.room].sides[one.side])}",
            "closed": one.closed,
            "width": one.width.as_dict(plan.unit),
            "height": one.height.as_dict(plan.unit),
            "probability": one.probability,
        }
        for number, one in enumerate(passed, start=1)
    ]


def clearance_lines(plan: FloorPlan) -> list[str]:
    """For the log."""
    return [
        f"clearance: {one['what']}, {_text(one['width'])} wide, {_text(one['height'])} high" for one in clearances(plan)
    ]


def _text(length: dict[str, Any]) -> str:
    return f"{length['value']:.2f} ± {length['sigma']:.2f} {length['unit']}"


def _room(plan: FloorPlan, number: int, scale: float) -> dict[str, Any]:
    room = plan.rooms[number]
    floor = room_area(room, scale)
    unseen = {"walls": None, "walls_net": None, "volume": None}
    found: dict[str, Any] = {"floor": _value(floor.value, floor.sigma), **unseen}
    if plan.height is None:
        return found
    height, tall = plan.height.value, float(np.hypot(plan.height.surface_m, plan.height.fit_m))
    round_m = sum(side.length_m for ring in (room.sides, *room.islands) for side in ring if side.wall is not None)
    ends = [side.measured for side in room.sides if side.measured is not None and side.wall is not None]
    around = float(np.linalg.norm([np.hypot(one.surface_m, one.fit_m) for one in ends]))
    own = np.hypot(round_m * tall, height * around)
    walls = round_m * height
    found["walls"] = _value(walls, np.hypot(own, 2 * scale * walls))
    holes = [one for one in plan.openings if one.room == number and one.kind != "niche" and not one.closed]
    gone = sum(one.width.value * one.height.value for one in holes)
    unsure = [np.hypot(one.width.value * one.height.sigma, one.height.value * one.width.sigma) for one in holes]
    net = walls - gone
    found["walls_net"] = _value(net, np.sqrt(own**2 + np.sum(np.square(unsure)) + (2 * scale * net) ** 2))
    flat = np.sqrt(max(0.0, floor.sigma**2 - (2 * scale * floor.value) ** 2))  # without the scale, which comes cubed
    volume = floor.value * height
    parts = height * flat, floor.value * tall, 3 * scale * volume
    found["volume"] = _value(volume, float(np.linalg.norm(parts)))
    return found


def _value(value: float, sigma: float) -> dict[str, float]:
    return {"value": float(value), "sigma": float(sigma)}
