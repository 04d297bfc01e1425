"""A floor plan as DXF, in metres: walls, openings, dimensions and texts on layers of their own."""

from __future__ import annotations

import io

from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.label import room_label
from room2dgs.plan.outline import Side
from room2dgs.plan.svg import opening_ends

LAYERS = {"WALLS": 7, "OPEN": 8, "DIMENSIONS": 5, "TEXT": 3, "DOORS": 30, "WINDOWS": 4, "NICHES": 9, "LOW_WALLS": 8}
LAYER_OF = {"door": "DOORS", "passage": "DOORS", "window": "WINDOWS", "niche": "NICHES"}
TEXT_M = 0.12
DIMENSION_M = 0.35  # between a wall and its dimension
SHORTEST_M = 0.15
FLAT = 1e-3  # slope of what is level or upright
METRES = 6


def dxf(plan: FloorPlan) -> str:
    """The whole file; needs ezdxf."""
    import ezdxf
    from ezdxf.enums import TextEntityAlignment

    document = ezdxf.new("R2010", setup=True)
    document.header["$INSUNITS"] = METRES
    document.header["$MEASUREMENT"] = 1
    for name, color in LAYERS.items():
        document.layers.add(name, color=color)
    space = document.modelspace()
    style = {
        "dimtxt": TEXT_M,
        "dimasz": 0.08,
        "dimexe": 0.05,
        "dimexo": 0.05,
        "dimgap": 0.04,
        "dimdec": 3,
        "dimlfac": 1,
    }
    for number, room in enumerate(plan.rooms, start=1):
        for ring in (room.sides, *room.islands):
            for side in ring:
                layer = "OPEN" if side.wall is None else "WALLS"
                space.add_line(tuple(side.start), tuple(side.end), dxfattribs={"layer": layer})
                if side.length_m >= SHORTEST_M:
                    start, end, off = _readable(side)
                    dimension = space.add_aligned_dim(
                        start,
                        end,
                        distance=off,
                        text=_text(side),
                        override=style,
                        dxfattribs={"layer": "DIMENSIONS"},
                    )
                    dimension.render()
        lines = [f"room {number}: {room.area_m2:.2f} m²"]
        lines += [] if plan.height_m is None else [f"height {plan.height_m:.3f} m"]
        place = room_label(room, lines, TEXT_M)
        for line, at in zip(lines, place.lines, strict=True):
            text = space.add_text(line, height=place.size_m, dxfattribs={"layer": "TEXT"})
            text.set_placement(tuple(at), align=TextEntityAlignment.MIDDLE_CENTER)
    for one in plan.openings:
        start, end = (tuple(point) for point in opening_ends(plan, one))
        space.add_line(start, end, dxfattribs={"layer": LAYER_OF[one.kind], "lineweight": 50})
    for wall in plan.low_walls:
        space.add_lwpolyline([tuple(corner) for corner in wall.corners], close=True, dxfattribs={"layer": "LOW_WALLS"})
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()


def _text(side: Side) -> str:
    """ "<>" stands for the dimension's own measure."""
    return "<>" if side.measured is None else f"<> ± {side.measured.sigma:.3f}"


def _readable(side: Side) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Ends of a dimension, from left to right or upwards so that its text is upright, and how far to its left the
    dimension stands: outside the room, which lies to the left of the side.
    """
    dx, dy = side.end - side.start
    flat = abs(dy) <= FLAT * abs(dx)
    if dx > 0 if flat or abs(dx) > FLAT * abs(dy) else dy > 0:
        return tuple(side.start), tuple(side.end), -DIMENSION_M
    return tuple(side.end), tuple(side.start), DIMENSION_M
