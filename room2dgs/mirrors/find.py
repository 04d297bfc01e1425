"""The mirrors of a room, from the small maps of its views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from room2dgs.geometry.up_axis import up_axis
from room2dgs.mirrors.grid import CELL_M, WallGrid, grid_on
from room2dgs.mirrors.mirror import Mirror, behind_glass, shown
from room2dgs.mirrors.reflection import Patch, gaps, mirroring
from room2dgs.mirrors.settle import settled
from room2dgs.mirrors.sights import SmallView, sights_of
from room2dgs.mirrors.walls import Plane, walls_of

MOST = 12  # mirrors of a room


def find_mirrors(views: Sequence[SmallView]) -> list[Mirror]:
    """The surest first; what one shows is not asked for the next."""
    if not any((view.depth > 0).any() for view in views):
        return []
    up = up_axis([view.camera for view in views], np.zeros((0, 3)))
    planes = _asked_planes(views, up)
    found: list[Mirror] = []
    while planes and len(found) < MOST:
        mirror = _surest(planes, views, up)
        if mirror is None:
            break
        found.append(mirror)
        views = [_without(view, mirror) for view in views]
    return found


def _asked_planes(views: Sequence[SmallView], up: np.ndarray) -> list[Plane]:
    """Planes of walls that are seen through somewhere, moved to where they mirror best; most rooms have none."""
    sights = sights_of(views)
    walls = [wall for wall in walls_of(views) if (grid := grid_on(wall, sights, up)) is not None and gaps(grid, sights)]
    return [plane for wall in walls if (plane := settled(wall, sights)) is not None]


def _surest(planes: Sequence[Plane], views: Sequence[SmallView], up: np.ndarray) -> Mirror | None:
    sights = sights_of(views)
    found: list[tuple[WallGrid, Patch]] = []
    for plane in planes:
        grid = grid_on(plane, sights, up)
        if grid is not None:
            found += [(grid, patch) for patch in mirroring(grid, sights, views)]
    if not found:
        return None
    grid, patch = max(found, key=lambda one: one[1].score)
    return Mirror(_corners(grid, patch.rectangle), patch.photos)


def _corners(grid: WallGrid, rectangle: np.ndarray) -> np.ndarray:
    """(4, 3) of a rectangle of cells."""
    low, high = rectangle
    corner = grid.low + CELL_M * np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    return corner @ grid.axes + grid.plane.normal * grid.plane.offset_m


def _without(view: SmallView, mirror: Mirror) -> SmallView:
    """The view with the glass in place of what is seen in it, which is no measurement."""
    glass = shown(view.depth, view.camera, [mirror])
    return replace(
        view,
        depth=behind_glass(view.depth, glass),
        num_consistent=np.where(glass > 0, 0, view.num_consistent),
    )
