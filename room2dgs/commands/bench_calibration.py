"""`room2dgs bench calibration RUN...`: expected errors of meshes against the true ones."""

from __future__ import annotations

import json
from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.report.table import terminal
from room2dgs.runs.folder import earlier_run

USAGE = "room2dgs bench calibration RUN... [to=FILE]"


def main(argv: list[str]) -> int:
    """Hold the expected error of each mesh's surface against the true one.

    RUN is a run of a capture with a ground truth. Printed are the shares of the surface whose true error is within one,
    two and three expected ones (0.68, 0.95 and 0.997 of a normal distribution), and AUSE: how much is lost against the
    best order when the most doubtful parts are taken away first, by expected error and by the number of views; for the
    whole mesh and by what it rests on. A truth has errors of its own; a rendered one has none. to= writes JSON.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    own, runs = own_arguments(argv, ("to",))
    if not runs:
        raise InputError("no run is given; name the folders of runs of captures with a ground truth")
    from room2dgs.bench.calibration import as_json, calibrations, run_errors, tables

    found = {}
    for folder in runs:
        found[Path(folder).name] = calibrations(run_errors(earlier_run([f"out={folder}"])))
    for one in tables(found):
        print(terminal(one))
    if "to" in own:
        to = Path(own["to"]).expanduser()
        with whole_file(to) as temporary:
            temporary.write_text(json.dumps(as_json(found), indent=1) + "\n", encoding="utf-8")
    return 0
