"""How large a run's room is, its plan, its dimensions, and its mesh with the photos on it: for its page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.pipeline.export import source_of
from room2dgs.pipeline.measure import level_plan
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import MESH, TEXTURED
from room2dgs.runs.page.room import RoomFacts, read_glb

if TYPE_CHECKING:
    from room2dgs.plan.floor_plan import FloorPlan
    from room2dgs.primitives.primitive import Splats
    from room2dgs.report.table import Table


def room_facts(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> tuple[RoomFacts, Table | None]:
    """What is known of the room in the run's folder, and its dimensions; None: no plan, or not how sure they are.

    Args:
        scene: with the poses that the run worked with.
        surfels: None: nothing was trained.
    """
    if not (run.path / MESH).is_file():
        return RoomFacts(), None
    source = source_of(config, run.log)
    source.scene = scene
    if surfels is not None:
        source.surfels = surfels
    facts = RoomFacts()
    glb = read_glb(run.path / TEXTURED)
    if glb is not None:
        facts = facts._replace(glb=glb, scene_from_glb=source.y_up.T)
    try:
        plan, scale = level_plan(source, config, run.log)
    except InputError as error:
        run.log(f"no floor plan on the page: {error}")
        return facts, None
    from room2dgs.plan.dimensions import dimensions_table

    dimensions = None if scale is None else dimensions_table(plan, scale)
    return _with_plan(facts, plan, run.path.absolute().name), dimensions


def _with_plan(facts: RoomFacts, plan: FloorPlan, title: str) -> RoomFacts:
    from room2dgs.plan.svg import svg

    corners = np.array([side.start for side in plan.rooms[0].sides])
    longer, shorter = sorted(np.ptp(corners, axis=0), reverse=True)
    return facts._replace(
        plan=svg(plan, title),
        size_m=(float(longer), float(shorter)),
        area_m2=float(sum(room.area_m2 for room in plan.rooms)),
        height_m=plan.height_m,
        level_from_world=plan.level_from_world,
    )
