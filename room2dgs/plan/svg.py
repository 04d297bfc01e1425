"""A floor plan as SVG: walls, lengths along them, area and height, a scale."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.label import room_label
from room2dgs.plan.opening import Opening
from room2dgs.plan.outline import Side
from room2dgs.texts import shown

PX_PER_M = 100.0
MARGIN_M = 0.8
TEXT_M, SMALL_M = 0.14, 0.11
LABEL_M = 0.18  # between a wall and its length
COLORS = {"door": "#b4632d", "passage": "#f2efe8", "window": "#5aa0d8", "niche": "#c9c2b4"}
SHORTEST_M = 0.15  # sides without a label
ROOM_FOR_SIGMA_M = 1.0  # along a side: its length is written with its standard deviation


def svg(plan: FloorPlan, title: str) -> str:
    """The whole file; 100 units are 1 m, y of the plan points up."""
    points = np.concatenate([[side.start for side in room.sides] for room in plan.rooms])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    width, height = (high - low) * PX_PER_M
    root = ET.Element("svg", xmlns="http://www.w3.org/2000/svg", viewBox=f"0 0 {width:.1f} {height:.1f}")
    root.set("width", f"{width / 10:.1f}mm")  # 1 : 100 on paper
    root.set("height", f"{height / 10:.1f}mm")
    root.set("font-family", "sans-serif")
    ET.SubElement(root, "title").text = shown(title)
    ET.SubElement(root, "rect", width=f"{width:.1f}", height=f"{height:.1f}", fill="white")

    def place(point: np.ndarray) -> tuple[float, float]:
        x, y = (np.asarray(point) - low) * PX_PER_M
        return float(x), float(height - y)

    def write(point: np.ndarray, text: str, size_m: float, turn_deg: float = 0.0) -> None:
        x, y = place(point)
        item = ET.SubElement(root, "text", x=f"{x:.2f}", y=f"{y:.2f}", fill="#222")
        item.set("font-size", f"{size_m * PX_PER_M:.1f}")
        item.set("text-anchor", "middle")
        item.set("dominant-baseline", "central")
        if turn_deg:
            item.set("transform", f"rotate({turn_deg:.3f} {x:.2f} {y:.2f})")
        item.text = text

    for number, room in enumerate(plan.rooms, start=1):
        rings = [room.sides, *room.islands]
        path = " ".join(
            "M " + " L ".join("{:.2f} {:.2f}".format(*place(side.start)) for side in ring) + " Z" for ring in rings
        )
        area = ET.SubElement(root, "path", d=path, fill="#f2efe8")
        area.set("fill-rule", "evenodd")
        for side in (side for ring in rings for side in ring):
            (x1, y1), (x2, y2) = place(side.start), place(side.end)
            line = ET.SubElement(root, "line", x1=f"{x1:.2f}", y1=f"{y1:.2f}", x2=f"{x2:.2f}", y2=f"{y2:.2f}")
            line.set("stroke", "#222" if side.wall is not None else "#999")
            line.set("stroke-width", "4" if side.wall is not None else "2")
            line.set("stroke-linecap", "square")
            if side.wall is None:
                line.set("stroke-dasharray", "10 8")
            if side.length_m >= SHORTEST_M:
                write(*_label(side, plan.unit), TEXT_M, _turn(side))
        for one in (one for one in plan.openings if one.room == number - 1):
            _draw(root, one, [place(point) for point in opening_ends(plan, one)], plan.unit)
        lines = [f"room {number}: {room.area_m2:.2f} m²"]
        if plan.height_m is not None:
            lines.append(
                f"height {plan.height_m:.2f} m" if plan.height is None else f"height {plan.height.text(plan.unit)}"
            )
        label = room_label(room, lines, TEXT_M)
        for text, at in zip(lines, label.lines, strict=True):
            write(at, text, label.size_m)
    for wall in plan.low_walls:
        outline = " L ".join("{:.2f} {:.2f}".format(*place(corner)) for corner in wall.corners)
        item = ET.SubElement(root, "path", d=f"M {outline} Z", fill="#d8d2c4", stroke="#222")
        item.set("class", "low-wall")
        ET.SubElement(item, "title").text = f"low wall, {wall.high_m:.2f} {plan.unit} high"
    _scale(root, height)
    return ET.tostring(root, encoding="unicode") + "\n"


def _label(side: Side, unit: str) -> tuple[np.ndarray, str]:
    """Where a side's length stands, outside the room, and what it says."""
    along = (side.end - side.start) / side.length_m
    return (side.start + side.end) / 2 + LABEL_M * np.array([along[1], -along[0]]), side_text(side, unit)


def opening_ends(plan: FloorPlan, one: Opening) -> tuple[np.ndarray, np.ndarray]:
    """(2,) each, in the plan."""
    side = plan.rooms[one.room].sides[one.side]
    along = (side.end - side.start) / side.length_m
    return side.start + one.start_m * along, side.start + one.end_m * along


def _draw(root: ET.Element, one: Opening, ends: list[tuple[float, float]], unit: str) -> None:
    """A gap in the wall; a window's pane in it, a door's leaf beside it."""
    (x1, y1), (x2, y2) = ends
    item = ET.SubElement(root, "line", x1=f"{x1:.2f}", y1=f"{y1:.2f}", x2=f"{x2:.2f}", y2=f"{y2:.2f}")
    item.set("stroke", COLORS[one.kind])
    item.set("stroke-width", "6")
    item.set("class", one.kind)
    ET.SubElement(item, "title").text = (
        f"{'closed ' if one.closed else ''}{one.kind}, {one.width.text(unit)} wide, {one.height.text(unit)} high, "
        f"{one.low_m:.2f} m over the floor, probability {one.probability:.2f}"
    )


def side_text(side: Side, unit: str) -> str:
    """Its length, with one standard deviation where there is room for it."""
    if side.measured is None or side.length_m < ROOM_FOR_SIGMA_M:
        return f"{side.length_m:.2f} m"
    return side.measured.text(unit)


def _turn(side: Side) -> float:
    """Degrees clockwise on the page, never upside down."""
    angle = np.degrees(np.arctan2(side.end[1] - side.start[1], side.end[0] - side.start[0]))
    return float(-((angle + 89.0) % 180.0 - 89.0))


def _scale(root: ET.Element, height: float) -> None:
    y = height - 20
    ET.SubElement(root, "path", d=f"M 20 {y - 5:.1f} v 5 h {PX_PER_M:.0f} v -5", fill="none", stroke="#222")
    text = ET.SubElement(root, "text", x=f"{20 + PX_PER_M / 2:.1f}", y=f"{y - 8:.1f}", fill="#222")
    text.set("font-size", f"{SMALL_M * PX_PER_M:.1f}")
    text.set("text-anchor", "middle")
    text.text = "1 m"
