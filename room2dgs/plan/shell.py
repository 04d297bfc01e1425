"""The room without its furniture: walls with openings, floor and ceiling as one closed solid."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import trimesh

from room2dgs.errors import InputError
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.opening import Opening
from room2dgs.plan.svg import opening_ends

WALL_M = 0.12  # thickness of walls, floor and ceiling, whose other sides nobody has seen
UNSEEN_TOP_M = 2.5  # of walls whose ceiling was not seen
MITRE = 5.0
GRID_M = 1e-6


def shell(plan: FloorPlan) -> trimesh.Trimesh:
    """Watertight, in the level frame of the plan; faces wind counter-clockwise seen from the air.

    The solid is cut at the heights of all openings. Between two such heights its section is the same, so that all faces
    are either upright over edges of one arrangement of lines, or level over cells of it, and fit edge to edge.

    Raises:
        InputError: the plan has no room.
    """
    import shapely

    if not plan.rooms:
        raise InputError("the plan has no room, so there is no shell")
    air = shapely.union_all([_polygon(room) for room in plan.rooms], grid_size=GRID_M)
    outside = air.buffer(WALL_M, join_style="mitre", mitre_limit=MITRE)
    outside = shapely.union_all([shapely.Polygon(part.exterior) for part in _parts(outside)])
    holes = [(one, _footprint(plan, one)) for one in plan.openings]
    lines = shapely.unary_union(
        [shape.boundary for shape in (air, outside, *(shape for _, shape in holes))], grid_size=GRID_M
    )
    cells = [cell for cell in shapely.polygonize([lines]).geoms if outside.contains(cell.representative_point())]
    floor, top = plan.floor.offset_m, plan.floor.offset_m + (plan.height_m or UNSEEN_TOP_M)
    between = (floor + z for one, _ in holes for z in (one.low_m, one.high_m))
    cuts = sorted({floor, top, *(z for z in between if floor < z < top)})
    levels = [floor - WALL_M, *cuts, *([top + WALL_M] if plan.ceiling is not None else [])]
    middles = [(low + high) / 2 for low, high in pairwise(levels)]
    solid = [[_is_solid(cell, z, floor, top, air, holes) for z in middles] for cell in cells]
    return _meshed(cells, levels, np.array(solid, bool))


def _is_solid(cell: Any, z: float, floor: float, top: float, air: Any, holes: list[tuple[Opening, Any]]) -> bool:
    if not floor < z < top:
        return True
    at = cell.representative_point()
    if air.contains(at):
        return False
    return not any(one.low_m < z - floor < one.high_m and shape.contains(at) for one, shape in holes)


def _meshed(cells: list[Any], levels: list[float], solid: np.ndarray) -> trimesh.Trimesh:
    """The boundary of the cells that are solid; solid (C, L - 1) bool by cell and interval of levels."""
    import shapely

    corners: list[np.ndarray] = []
    edges: dict[tuple[tuple[float, float], tuple[float, float]], int] = {}
    for number, cell in enumerate(map(shapely.orient_polygons, cells)):
        for ring in (cell.exterior, *cell.interiors):
            points = [(round(x, 6), round(y, 6)) for x, y in ring.coords]
            edges.update({(a, b): number for a, b in pairwise(points)})  # the cell on the left
        flat = [np.round(np.asarray(shapely.orient_polygons(part).exterior.coords)[:3], 6) for part in _triangles(cell)]
        whole = np.r_[False, solid[number], False]
        for level in range(len(levels)):
            below, above = whole[level], whole[level + 1]
            if below != above:
                for triangle in flat:
                    face = np.column_stack([triangle, np.full(3, levels[level])])
                    corners.append(face if below else face[::-1])
    nothing = np.zeros(len(levels) - 1, bool)
    for (a, b), number in edges.items():
        other = edges.get((b, a))
        beside = nothing if other is None else solid[other]
        for at in map(int, np.flatnonzero(solid[number] & ~beside)):
            low, high = levels[at], levels[at + 1]
            quad = np.array([(*a, low), (*b, low), (*b, high), (*a, high)])
            corners += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
    vertices = np.concatenate(corners)
    unique, index = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    return trimesh.Trimesh(unique, index.reshape(-1, 3), process=False)


def _triangles(cell: Any) -> list[Any]:
    import shapely

    return list(shapely.constrained_delaunay_triangles(cell).geoms)


def _footprint(plan: FloorPlan, one: Opening) -> Any:
    """What an opening takes of the wall, seen from above: through it, or as deep as its back was seen."""
    import shapely

    start, end = opening_ends(plan, one)
    along = (end - start) / np.linalg.norm(end - start)
    outwards = np.array([along[1], -along[0]])  # the room is on the left of its sides
    is_recess = one.depth_m is not None and one.kind == "niche"
    deep = min(float(one.depth_m or 0), 0.8 * WALL_M) if is_recess else 1.5 * WALL_M
    return shapely.Polygon([start, end, end + deep * outwards, start + deep * outwards])


def _polygon(room: Any) -> Any:
    import shapely

    islands = [[side.start for side in ring] for ring in room.islands]
    return shapely.Polygon([side.start for side in room.sides], islands).buffer(0)


def _parts(shape: Any) -> list[Any]:
    return list(getattr(shape, "geoms", [shape]))
