"""The floor plan of a run: plan.json, plan.svg, plan.dxf."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.export import source_of
from room2dgs.pipeline.measure import level_plan, needed_for_plans
from room2dgs.runs.folder import MESH, at_work_beside, required

if TYPE_CHECKING:
    from room2dgs.lengths.scale import ScaleTrust
    from room2dgs.plan.floor_plan import FloorPlan

PLAN = "plan"
PLACES = {"shell": "shell.ply", "ifc": "plan.ifc"}


EXTRAS = ("shell", "ifc")


def write_plan(config: Config, out: Path | None = None, log: Log = to_terminal, extras: Sequence[str] = ()) -> Path:
    """Finds floor, ceiling, walls and openings in the run in config.out, and draws them.

    Args:
        out: the folder for the files; None: `plan` in the run's.
        extras: of `EXTRAS`, what is written besides.

    Returns:
        The folder.

    Raises:
        InputError: a library is missing, the run has no mesh, no way is up, or no floor is found.
    """
    needed_for_plans("shapely", "ezdxf")
    if "ifc" in extras and importlib.util.find_spec("ifcopenshell") is None:
        raise InputError("to=ifc needs ifcopenshell; install it with pip install 'room2dgs[plan]'")
    run = Path(config.out)
    required(run / MESH, "mesh")
    from room2dgs.plan.floor_plan import plan_in_world, sentences
    from room2dgs.plan.quantities import clearance_lines

    source = source_of(config, log)
    level, scale = level_plan(source, config, log)
    plan = plan_in_world(level, source.origin_m)
    for line in (*sentences(plan), *clearance_lines(plan)):
        log(line)
    out = (out or run / PLAN).expanduser().absolute()
    files = _files(plan, scale, run.name, extras)
    try:
        with at_work_beside(config, out):
            for name, data in files.items():
                with whole_file(out / name) as temporary:
                    temporary.write_bytes(data)
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
    log(f"floor plan: {out / 'plan.svg'}, {out / 'plan.dxf'}, planes: {out / 'plan.json'}")
    for extra in extras:
        log(f"{extra}: {out / PLACES[extra]}")
    return out


def _files(plan: FloorPlan, scale: ScaleTrust | None, name: str, extras: Sequence[str]) -> dict[str, bytes]:
    """Name -> content, of all that is asked for."""
    from room2dgs.plan.dxf import dxf
    from room2dgs.plan.floor_plan import as_json
    from room2dgs.plan.quantities import quantities
    from room2dgs.plan.svg import svg

    measured = {} if scale is None else quantities(plan, scale)
    files = {
        "plan.json": (json.dumps({**as_json(plan), **({"quantities": measured} if measured else {})}, indent=1) + "\n"),
        "plan.svg": svg(plan, name),
        "plan.dxf": dxf(plan),
    }
    found = {key: text.encode("utf-8") for key, text in files.items()}
    if "shell" in extras:
        from room2dgs.mesh.ply_bytes import ply_bytes
        from room2dgs.plan.shell import shell

        closed = shell(plan)
        closed.vertices = np.asarray(closed.vertices) @ plan.level_from_world
        found[PLACES["shell"]] = ply_bytes(closed)
    if "ifc" in extras:
        from room2dgs.plan.ifc import ifc

        found[PLACES["ifc"]] = ifc(plan, name).encode("utf-8")
    return found
