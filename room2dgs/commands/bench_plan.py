"""`room2dgs bench plan RUN...`: plans of runs of made rooms against the truth."""

from __future__ import annotations

import json
from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.report.table import terminal
from room2dgs.runs.folder import earlier_run

USAGE = "room2dgs bench plan RUN... [to=FILE]"


def main(argv: list[str]) -> int:
    """Score the plans of runs of made rooms: walls, rooms, doors and windows within 10 cm of the truth.

    RUN is a run of a capture that `python -m room2dgs.tools.make_captures` made. Of the room that was filmed all is
    asked for, also what no photo shows; what a plan says of rooms behind its doors may be right or wrong. to= writes
    all counts as JSON.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    own, runs = own_arguments(argv, ("to",))
    if not runs:
        raise InputError("no run is given; name the folders of runs of made rooms")
    from room2dgs.bench.lengths import truth_of
    from room2dgs.bench.plan import as_json, counted, tables
    from room2dgs.pipeline.measure import measured_run

    counts = []
    for folder in runs:
        config = earlier_run([f"out={folder}", "export.up=z"])
        truth, name = truth_of(config), Path(config.scene.path).name
        run = measured_run(config, print, 0.0)
        try:
            plan = run.plan_with_openings
        except InputError as error:
            print(f"{name}: {error}")
            plan = None
        counts += counted(plan, name, truth)
    for one in tables(counts):
        print(terminal(one))
    if "to" in own:
        with whole_file(Path(own["to"]).expanduser()) as temporary:
            temporary.write_text(json.dumps(as_json(counts), indent=1) + "\n", encoding="utf-8")
    return 0
