"""The dimensions of a plan's rooms in words and plain values, each with its standard deviation."""

from __future__ import annotations

from typing import Any

from room2dgs.lengths.length import Length
from room2dgs.lengths.scale import ScaleTrust
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.sigmas import room_area
from room2dgs.report.table import Table, table

SHORTEST_M = 0.15  # sides shorter than this are not listed


def lengths_of(plan: FloorPlan) -> list[tuple[str, Length]]:
    """Height and sides of the rooms by name: "height", "room 1, wall_2"."""
    found = [] if plan.height is None else [("height", plan.height)]
    for number, room in enumerate(plan.rooms, start=1):
        for side in room.sides:
            if side.measured is not None and side.length_m >= SHORTEST_M:
                found.append((f"room {number}, {plan.wall_name(side)}", side.measured))
    return found


def dimensions(plan: FloorPlan, scale: ScaleTrust) -> dict[str, Any]:
    """Plain values of all lengths and areas."""
    areas = [room_area(room, scale.sigma) for room in plan.rooms]
    return {
        "unit": scale.unit,
        "scale": scale.words,
        "lengths": [{"what": name, **length.as_dict(scale.unit)} for name, length in lengths_of(plan)],
        "areas": [
            {"what": f"room {number}, floor", "value": area.value, "sigma": area.sigma, "unit": f"{scale.unit}²"}
            for number, area in enumerate(areas, start=1)
        ],
    }


def dimensions_table(plan: FloorPlan, scale: ScaleTrust) -> Table:
    """For a report; ± is one standard deviation."""
    rows = [(name, length.text(scale.unit), length.rests_on) for name, length in lengths_of(plan)]
    for number, room in enumerate(plan.rooms, start=1):
        area = room_area(room, scale.sigma)
        rows.append((f"room {number}, floor", f"{area.value:.2f} ± {area.sigma:.2f} {scale.unit}²", "its sides"))
    rows.append(("scale", scale.words, "all of them"))
    columns = {
        "dimension": lambda row: row[0],
        "± one standard deviation": lambda row: row[1],
        "rests on": lambda row: row[2],
    }
    return table("Dimensions", columns, rows)
