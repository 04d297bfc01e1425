"""`room2dgs compare`: two runs on one page."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError

USAGE = "room2dgs compare RUN RUN [to=compare.html]"


def main(argv: list[str]) -> int:
    """Write compare.html of two runs: the settings that differ, their scores, and both rooms side by side, seen by one
    camera. It opens without a network.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    own, runs = own_arguments(argv, ("to",))
    if len(runs) != 2:
        raise InputError(f"two runs are compared, {len(runs)} given: {USAGE}")
    from room2dgs.pipeline.compare import compare_runs

    to = Path(own.get("to") or "compare.html").expanduser().absolute()
    first, second = (Path(run).expanduser().absolute() for run in runs)
    compare_runs(first, second, to)
    return 0
