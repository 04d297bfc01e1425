"""The floor plan of a run: plan.json, plan.svg, plan.dxf."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.world_offset import Origin
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.export import source_of
from room2dgs.pipeline.measure import NotSure, measured_run, needed_for_plans, plan_of
from room2dgs.runs.folder import MESH, at_work_beside, required

if TYPE_CHECKING:
    from room2dgs.plan.floor_plan import FloorPlan

PLAN = "plan"


def write_plan(config: Config, out: Path | None = None, log: Log = to_terminal) -> Path:
    """Finds floor, ceiling and walls in the mesh of the run in config.out, and draws them.

    Args:
        out: the folder for the files; None: `plan` in the run's.

    Returns:
        The folder.

    Raises:
        InputError: a library is missing, the run has no mesh, no way is up, or no floor is found.
    """
    needed_for_plans("shapely", "ezdxf")
    run = Path(config.out)
    required(run / MESH, "mesh")
    from room2dgs.plan.dxf import dxf
    from room2dgs.plan.floor_plan import as_json, plan_in_world, sentences
    from room2dgs.plan.svg import svg

    plan, origin_m = _plan(config, log)
    plan = plan_in_world(plan, origin_m)
    for line in sentences(plan):
        log(line)
    out = (out or run / PLAN).expanduser().absolute()
    texts = {
        "plan.json": json.dumps(as_json(plan), indent=1) + "\n",
        "plan.svg": svg(plan, run.name),
        "plan.dxf": dxf(plan),
    }
    try:
        with at_work_beside(config, out):
            for name, text in texts.items():
                with whole_file(out / name) as temporary:
                    temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
    log(f"floor plan: {out / 'plan.svg'}, {out / 'plan.dxf'}, planes: {out / 'plan.json'}")
    return out


def _plan(config: Config, log: Log) -> tuple[FloorPlan, Origin]:
    """The plan in its level frame, measured where the run says how sure it is, and the scene's origin."""
    try:
        measured = measured_run(config, log)
        return measured.plan_with_openings, measured.source.origin_m
    except NotSure as error:
        log(f"lengths without deviations: {error}")
        source = source_of(config, log)
        return plan_of(source), source.origin_m
