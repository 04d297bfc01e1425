"""A plan as IFC4: storey, spaces, walls with openings, doors, windows, slabs; metres."""

from __future__ import annotations

from typing import Any

import numpy as np

from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.opening import Opening
from room2dgs.plan.outline import Outline, Side
from room2dgs.plan.shell import UNSEEN_TOP_M, WALL_M

FILLING = {"door": "IfcDoor", "window": "IfcWindow"}
LEAF_M = 0.05  # thickness of a door's or window's body


class _Model:
    """A file that is being written, and what all its bodies share."""

    def __init__(self, name: str) -> None:
        import ifcopenshell
        from ifcopenshell.api import aggregate, context, project, root, unit

        self.file: ifcopenshell.file = project.create_file("IFC4")
        self.project = root.create_entity(self.file, "IfcProject", name=name)
        metre, square, cube = (unit.add_si_unit(self.file, kind) for kind in ("LENGTHUNIT", "AREAUNIT", "VOLUMEUNIT"))
        unit.assign_unit(self.file, [metre, square, cube])
        model = context.add_context(self.file, "Model")
        self.body = context.add_context(self.file, "Model", "Body", "MODEL_VIEW", parent=model)
        site, building, self.storey = (
            root.create_entity(self.file, kind, name=text)
            for kind, text in (("IfcSite", "site"), ("IfcBuilding", "building"), ("IfcBuildingStorey", "storey"))
        )
        for inner, outer in ((site, self.project), (building, site), (self.storey, building)):
            aggregate.assign_object(self.file, [inner], outer)

    def element(self, kind: str, name: str, corners: np.ndarray, low: float, height: float) -> Any:
        """An upright prism over a polygon (N, 2)."""
        from ifcopenshell.api import geometry, root

        entity = root.create_entity(self.file, kind, name=name)
        points = [self._point(corner) for corner in (*corners, corners[0])]
        profile = self.file.createIfcArbitraryClosedProfileDef("AREA", None, self.file.createIfcPolyline(points))
        origin = self.file.createIfcAxis2Placement3D(self._point((0.0, 0.0, 0.0)))
        up = self.file.createIfcDirection((0.0, 0.0, 1.0))
        solid = self.file.createIfcExtrudedAreaSolid(profile, origin, up, float(height))
        shape = self.file.createIfcShapeRepresentation(self.body, "Body", "SweptSolid", [solid])
        geometry.assign_representation(self.file, entity, shape)
        at = np.eye(4)
        at[2, 3] = low
        geometry.edit_object_placement(self.file, entity, matrix=at)
        return entity

    def _point(self, values: Any) -> Any:
        return self.file.createIfcCartesianPoint(tuple(float(value) for value in values))

    def contains(self, *entities: Any) -> None:
        from ifcopenshell.api import spatial

        spatial.assign_container(self.file, list(entities), self.storey)

    def describe(self, entity: Any, name: str, values: dict[str, Any]) -> None:
        from ifcopenshell.api import pset

        pset.edit_pset(self.file, pset.add_pset(self.file, entity, name), properties=values)


def ifc(plan: FloorPlan, name: str) -> str:
    """The whole file; needs ifcopenshell.

    Args:
        plan: in the frame that the file is to have, z up.
        name: of the project.
    """
    from ifcopenshell.api import aggregate

    model = _Model(name)
    floor, height = plan.floor.offset_m, plan.height_m or UNSEEN_TOP_M
    for number, room in enumerate(plan.rooms, start=1):
        outline = np.array([side.start for side in room.sides])
        space = model.element("IfcSpace", f"room {number}", outline, floor, height)
        aggregate.assign_object(model.file, [space], model.storey)
        slab = model.element("IfcSlab", f"floor {number}", outline, floor - WALL_M, WALL_M)
        slab.PredefinedType = "FLOOR"
        model.contains(slab)
        for index, side in enumerate(room.sides):
            if side.wall is not None:
                _wall(model, plan, room, number - 1, index, side, floor, height)
    for number, low in enumerate(plan.low_walls, start=1):
        wall = model.element("IfcWall", f"low wall {number}", low.corners, floor, low.high_m)
        wall.PredefinedType = "PARAPET"
        model.contains(wall)
    return model.file.to_string()


def _wall(
    model: _Model, plan: FloorPlan, room: Outline, number: int, index: int, side: Side, floor: float, height: float
) -> None:
    wall = model.element("IfcWall", plan.wall_name(side), _behind(side, 0.0, side.length_m, WALL_M), floor, height)
    model.contains(wall)
    if side.measured is not None:
        model.describe(wall, "Room2dgs_Measured", {"Length": side.measured.value, "LengthSigma": side.measured.sigma})
    for one in plan.openings:
        if (one.room, one.side) == (number, index):
            _opening(model, wall, one, side, floor)


def _opening(model: _Model, wall: Any, one: Opening, side: Side, floor: float) -> None:
    from ifcopenshell.api import feature

    deep = min(float(one.depth_m or WALL_M), 0.8 * WALL_M) if one.kind == "niche" else 1.5 * WALL_M
    size = one.high_m - one.low_m
    hole = model.element(
        "IfcOpeningElement", one.kind, _behind(side, one.start_m, one.end_m, deep), floor + one.low_m, size
    )
    hole.PredefinedType = "RECESS" if one.kind == "niche" else "OPENING"
    feature.add_feature(model.file, hole, wall)
    if one.kind not in FILLING:
        return
    body = _behind(side, one.start_m, one.end_m, LEAF_M)
    filling = model.element(FILLING[one.kind], one.kind, body, floor + one.low_m, size)
    filling.OverallWidth, filling.OverallHeight = one.width.value, one.height.value
    feature.add_filling(model.file, hole, filling)
    model.contains(filling)
    model.describe(
        filling,
        "Room2dgs_Measured",
        {"WidthSigma": one.width.sigma, "HeightSigma": one.height.sigma, "Probability": one.probability},
    )


def _behind(side: Side, start: float, end: float, deep: float) -> np.ndarray:
    """(4, 2) corners of a strip behind a side, counter-clockwise."""
    along = (side.end - side.start) / side.length_m
    outwards = np.array([along[1], -along[0]])  # the room is on the left of its sides
    first, last = side.start + start * along, side.start + end * along
    return np.array([first, first + deep * outwards, last + deep * outwards, last])
