"""`room2dgs plan`: floor, ceiling and walls of a run by name, and a floor plan with dimensions."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.own_arguments import choices, own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.commands.short_keys import with_full_keys
from room2dgs.errors import InputError
from room2dgs.pipeline.plan import EXTRAS, write_plan
from room2dgs.runs.folder import earlier_run, last_value

USAGE = "room2dgs plan RUN [out=DIR] [to=shell,ifc] [up=auto|x|y|z|-x|-y|-z]"


def main(argv: list[str]) -> int:
    """Find floor, ceiling, walls, doors and windows of an earlier run; write plan.json, plan.svg and plan.dxf.

    To RUN/plan unless out= says otherwise. Lengths are metres between the planes of the walls; sides where no wall was
    found are called open. to=shell adds shell.ply, the room without furniture as a closed mesh; to=ifc adds plan.ifc,
    the plan as IFC4 (pip install 'room2dgs[plan]').
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    run, out = last_value(argv, "run"), last_value(argv, "out")
    if not run:
        raise InputError("run is not given; add run=DIR, the folder of an earlier run")
    own, rest = own_arguments(argv, ("run", "out", "to"))
    extras = choices(own, "to", "", EXTRAS) if "to" in own else ()
    config = earlier_run([*with_full_keys(rest, {"up": "export.up"}), f"out={run}"])
    write_plan(config, Path(out) if out else None, extras=extras)
    return 0
