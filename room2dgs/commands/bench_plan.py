"""`room2dgs bench plan RUN...`: plans of runs of made rooms against the truth."""

from __future__ import annotations

from room2dgs.commands.made_rooms import given_rooms, print_tables
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError

USAGE = "room2dgs bench plan RUN... [to=FILE]"


def main(argv: list[str]) -> int:
    """Score the plans of runs of made rooms: walls, rooms, doors and windows within 10 cm of the truth.

    RUN is a run of a capture that `python -m room2dgs.tools.make_captures` made. Of the room that was filmed all is
    asked for; what a plan says of rooms behind its doors may be right or wrong. Doors and windows count apart where
    photos do not show each side of their rim. to= writes all counts as JSON.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    rooms, to = given_rooms(argv)
    from room2dgs.bench.openings_seen import sides_seen
    from room2dgs.bench.plan import as_json, counted, tables

    counts = []
    for name, truth, run in rooms:
        try:
            plan = run.plan_with_openings
        except InputError as error:
            print(f"{name}: {error}")
            plan = None
        counts += counted(plan, name, truth, sides_seen(truth, run.source.scene.train))
    print_tables(tables(counts), as_json(counts), to)
    return 0
