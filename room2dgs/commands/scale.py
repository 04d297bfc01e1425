"""`room2dgs scale`: an earlier run at another scale, by a known length."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.commands.short_keys import with_full_keys
from room2dgs.errors import InputError
from room2dgs.logs import to_terminal
from room2dgs.pipeline.rescale import rescale_run, rescaling_of
from room2dgs.runs.folder import earlier_run, last_value
from room2dgs.runs.replacing import left, unfinished

USAGE = "room2dgs scale RUN ONE OTHER length=METRES[+-METRES] [up=auto|x|y|z|-x|-y|-z]"


def main(argv: list[str]) -> int:
    """Scale an earlier run so that what lies between two ends is as long as it is known to be.

    ONE and OTHER are what `room2dgs measure` takes: points of the mesh, pixels of photos, planes. length= is what you
    measured there, with its standard deviation (5 mm unless said). Mesh, surfels, poses, small maps and figures are
    replaced together, or not at all; report, plan and exports are made again, scores against a truth go. Stopped, the
    same command without ends and length goes on.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    run = last_value(argv, "run")
    if not run:
        raise InputError("run is not given; add run=DIR, the folder of an earlier run")
    own, rest = own_arguments(argv, ("run", "length", "up"))
    folder = Path(run).expanduser()
    stopped = unfinished(folder) or bool(left(folder))
    settings = with_full_keys([f"up={own['up']}"] if "up" in own else [], {"up": "export.up"})
    config = earlier_run([*settings, f"out={run}"], unfinished_too=True)
    if stopped:
        rescale_run(config, None, to_terminal)
        if not rest and "length" not in own:
            return 0
        raise InputError(f"{run} was finished at the scale that it was being brought to; give the command again")
    if len(rest) != 2 or "length" not in own:
        raise InputError("two ends and length=METRES are wanted, for example: 0,0,0 2,0,0 length=2.04+-0.005")
    rescale_run(config, rescaling_of(config, rest[0], rest[1], own["length"], to_terminal), to_terminal)
    return 0
