"""`room2dgs bench lengths RUN...`: lengths of runs of made rooms against the truth."""

from __future__ import annotations

from room2dgs.commands.made_rooms import given_rooms, print_tables
from room2dgs.commands.settings_help import asked_for_help, filled

USAGE = "room2dgs bench lengths RUN... [to=FILE]"


def main(argv: list[str]) -> int:
    """Measure walls, heights, doors, windows and tops of tables in runs of made rooms, and compare them with the truth.

    RUN is a run of a capture that `python -m room2dgs.tools.make_captures` made. Poses of made rooms are exact, so the
    scale has no deviation here. to= writes all lengths and figures as JSON.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    rooms, to = given_rooms(argv)
    from room2dgs.bench.lengths import as_json, measured_rows, tables

    rows = []
    for name, truth, run in rooms:
        rows += measured_rows(run, name, truth)
    print_tables(tables(rows), as_json(rows), to)
    return 0
