"""`room2dgs export`: an earlier run in the files of other programs."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled, settings
from room2dgs.commands.short_keys import with_full_keys
from room2dgs.errors import InputError
from room2dgs.pipeline.export import export_run
from room2dgs.registries.exporters import EXPORTERS, place_of
from room2dgs.runs.folder import earlier_run, last_value

USAGE = (
    "room2dgs export RUN to=FORMAT[,FORMAT...] [out=DIR] [up=auto] [faces=N] [max_error_m=0.01]\n"
    "                [KEY=VALUE ...]"
)
OWN = ("run", "to", "out")
SHORT = {"up": "export.up", "faces": "export.faces", "max_error_m": "export.max_error_m"}


def main(argv: list[str]) -> int:
    """Write an earlier run's results for other programs, to RUN/export unless out= says otherwise.

    up= turns splats and meshes so that they stand upright there, faces= and max_error_m= simplify meshes; to=all
    writes everything.
    """
    if asked_for_help(argv):
        return _help(argv)
    run, out = last_value(argv, "run"), last_value(argv, "out")
    if not run:
        raise InputError("run is not given; add run=DIR, the folder of an earlier run")
    own, rest = own_arguments(argv, OWN)
    config = earlier_run([*with_full_keys(rest, SHORT), f"out={run}"])
    names = [name for name in own.get("to", "").strip("[]").split(",") if name]
    export_run(config, names, Path(out) if out else None)
    return 0


def _help(argv: list[str]) -> int:
    print(f"{USAGE}\n\n{filled(main.__doc__ or '')}\n")
    for one in EXPORTERS.entries():
        print(f"  {one.name:<12} {place_of(one):<16} {one.description}")
    print("\n".join(["", *settings(argv, ("export",))]))
    return 0
