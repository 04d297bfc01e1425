"""`room2dgs plan`: floor, ceiling and walls of a run by name, and a floor plan with dimensions."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

from room2dgs.commands.export import source_of
from room2dgs.commands.settings_help import asked_for_help
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.logs import to_terminal
from room2dgs.runs.folder import MESH, at_work_beside, earlier_run, last_value, required

USAGE = "room2dgs plan run=DIR [out=DIR] [up=auto|x|y|z|-x|-y|-z]"
PLAN = "plan"


def main(argv: list[str]) -> int:
    """Find floor, ceiling and walls in an earlier run's mesh; write plan.json, plan.svg and plan.dxf.

    To RUN/plan unless out= says otherwise. Lengths are metres between the planes of the walls; sides where no wall was
    found are called open.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{main.__doc__}")
        return 0
    run = last_value(argv, "run")
    if not run:
        raise InputError("run is not given; add run=DIR, the folder of an earlier run")
    missing = [name for name in ("shapely", "ezdxf") if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"floor plans need {' and '.join(missing)}; install them with pip install 'room2dgs[export]'")
    rest = [text for text in argv if text.partition("=")[0] not in ("run", "out")]
    config = earlier_run([*(_written_out(text) for text in rest), f"out={run}"])
    folder = Path(config.out)
    required(folder / MESH, "mesh")
    source = source_of(config, to_terminal)
    if source.up is None:
        raise InputError("export.up=keep does not say which way is up; give up=auto or up=z")
    from room2dgs.plan.dxf import dxf
    from room2dgs.plan.floor_plan import as_json, floor_plan, plan_in_world, sentences
    from room2dgs.plan.svg import svg

    plan = plan_in_world(floor_plan(source.mesh, source.up), source.origin_m)
    for line in sentences(plan):
        to_terminal(line)
    out = Path(last_value(argv, "out") or folder / PLAN).expanduser().absolute()
    texts = {
        "plan.json": json.dumps(as_json(plan), indent=1) + "\n",
        "plan.svg": svg(plan, folder.name),
        "plan.dxf": dxf(plan),
    }
    try:
        with at_work_beside(config, out):
            for name, text in texts.items():
                with whole_file(out / name) as temporary:
                    temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
    to_terminal(f"floor plan: {out / 'plan.svg'}, {out / 'plan.dxf'}, planes: {out / 'plan.json'}")
    return 0


def _written_out(text: str) -> str:
    return f"export.{text}" if text.startswith("up=") else text
