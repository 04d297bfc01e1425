"""A floor plan as DXF, in metres: walls, openings, dimensions and texts on layers of their own."""

from __future__ import annotations

import io

import numpy as np

from room2dgs.plan.floor_plan import FloorPlan

LAYERS = {"WALLS": 7, "OPEN": 8, "DIMENSIONS": 5, "TEXT": 3}
TEXT_M = 0.12
DIMENSION_M = 0.35  # between a wall and its dimension
SHORTEST_M = 0.15
METRES = 6


def dxf(plan: FloorPlan) -> str:
    """The whole file; needs ezdxf."""
    import ezdxf

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
                    dimension = space.add_aligned_dim(
                        tuple(side.start),
                        tuple(side.end),
                        distance=-DIMENSION_M,
                        override=style,
                        dxfattribs={"layer": "DIMENSIONS"},
                    )
                    dimension.render()
        ends = np.array([side.start for side in room.sides])
        height = "" if plan.height_m is None else f", height {plan.height_m:.3f} m"
        text = space.add_text(
            f"room {number}: {room.area_m2:.2f} m2{height}", height=TEXT_M, dxfattribs={"layer": "TEXT"}
        )
        text.set_placement(tuple((ends.min(axis=0) + ends.max(axis=0)) / 2))
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()
