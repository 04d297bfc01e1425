"""The floor plan of a run: plan.json, plan.svg, plan.dxf."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.export import source_of
from room2dgs.runs.folder import MESH, at_work_beside, required

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
    missing = [name for name in ("shapely", "ezdxf") if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"floor plans need {' and '.join(missing)}; install them with pip install 'room2dgs[export]'")
    run = Path(config.out)
    required(run / MESH, "mesh")
    source = source_of(config, log)
    if source.up is None:
        raise InputError("export.up=keep does not say which way is up; give up=auto or up=z")
    from room2dgs.plan.dxf import dxf
    from room2dgs.plan.floor_plan import as_json, floor_plan, plan_in_world, sentences
    from room2dgs.plan.svg import svg

    plan = plan_in_world(floor_plan(source.mesh, source.up), source.origin_m)
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
