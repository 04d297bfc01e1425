"""`room2dgs bench lengths RUN...`: lengths of runs of made rooms against the truth."""

from __future__ import annotations

import json
from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.report.table import terminal
from room2dgs.runs.folder import earlier_run

USAGE = "room2dgs bench lengths RUN... [to=FILE]"


def main(argv: list[str]) -> int:
    """Measure walls, heights, doors, windows and tops of tables in runs of made rooms, and compare them with the truth.

    RUN is a run of a capture that `python -m room2dgs.tools.make_captures` made. Poses of made rooms are exact, so the
    scale has no deviation here. to= writes all lengths and figures as JSON.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    own, runs = own_arguments(argv, ("to",))
    if not runs:
        raise InputError("no run is given; name the folders of runs of made rooms")
    from room2dgs.bench.lengths import as_json, measured_rows, tables, truth_of
    from room2dgs.pipeline.measure import measured_run

    rows = []
    for folder in runs:
        config = earlier_run([f"out={folder}", "export.up=z"])
        truth = truth_of(config)
        rows += measured_rows(measured_run(config, print, 0.0), Path(config.scene.path).name, truth)
    for one in tables(rows):
        print(terminal(one))
    if "to" in own:
        to = Path(own["to"]).expanduser()
        with whole_file(to) as temporary:
            temporary.write_text(json.dumps(as_json(rows), indent=1) + "\n", encoding="utf-8")
    return 0
