"""`room2dgs report`: a run on one page."""

from __future__ import annotations

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.pipeline.loaded_run import loaded_run
from room2dgs.pipeline.report import write_run_report
from room2dgs.runs.folder import earlier_run

USAGE = "room2dgs report RUN [report.KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Write report.html of an earlier run again, with other settings if wanted. It opens without a network."""
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("report",))
    config = earlier_run(argv)
    with loaded_run(config) as (scene, surfels, run):
        write_run_report(scene, surfels, config, run)
    return 0
