"""Score against time for several settings on several captures.

python -m room2dgs.tools.tradeoff DIR...
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence

from room2dgs.commands.bench_prior import split_scenes
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.logs import in_lines, run_log
from room2dgs.runs.metrics import machine
from room2dgs.study.ablation import rows_of
from room2dgs.study.jobs import Job, finished, study_folder
from room2dgs.study.launch import of_hydra
from room2dgs.study.progress import Progress, run_all, run_of
from room2dgs.tools.command_line import command_line
from room2dgs.tools.tradeoff.page import HTML, write_page
from room2dgs.tools.tradeoff.points import JSON, Tradeoff, planned, points_of, sets, write_tables

USAGE = (
    f"python -m room2dgs.tools.tradeoff DIR... out=DIR [points={'|'.join(sets())}] [point='NAME: KEY=VALUE ...'] "
    "[train.seed=0,1,2] [KEY=VALUE ...]"
)
OURS = ("out", "resume", "point", "points")


@command_line("tradeoff")
def main(argv: list[str]) -> int:
    """Run each capture under several settings: one table of scores, seconds, memory and surfels, and a drawing.

    points=presets, the default, are runs from a mesh without training to one trained on photos of full size, with dense
    stereo alone, a Poisson surface of the sparse points and plain 2D Gaussian splatting beside; points=steps are what
    each part of the depth brings, points=stereo what comparing the photos does; point='NAME: KEY=VALUE ...', several
    times, are your own, alone or after a set that points= names. What is finished is not run again: after a kill or a
    failure the same command goes on. Photos alone count (prior=room_prior) unless a setting says otherwise.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__)
    out = study_folder(argv, JSON)
    hydra_settings = [text for text in argv if of_hydra(text)]
    rest = [text for text in argv if text.partition("=")[0] not in OURS and text not in hydra_settings]
    scenes, settings = split_scenes(rest)
    points = points_of(argv)
    jobs = planned(scenes, points, settings, out)
    progress = Progress([job for job in jobs if not finished(job)])
    out.mkdir(parents=True, exist_ok=True)
    log = run_log(out)
    command = shlex.join(["python", "-m", "room2dgs.tools.tradeoff", *argv])

    def write() -> str:
        return write_tables(_tradeoff(jobs, progress, command, points), out)

    write()  # first: it marks the folder as a study's
    in_lines(log, f"{command}\n{len(jobs)} runs, {len(jobs) - len(progress.todo)} of them finished before")
    run_all(progress, jobs, hydra_settings, out, log, write)
    in_lines(log, f"\n{write()}")
    write_page(_tradeoff(jobs, progress, command, points), out)
    log(f"drawing: {out / HTML}")
    return progress.code


def _tradeoff(jobs: Sequence[Job], progress: Progress, command: str, points: Mapping[str, Sequence[str]]) -> Tradeoff:
    """What is known so far."""
    threshold = jobs[0].config.eval.threshold_m
    words = {job.row: job.experiment for job in jobs}
    rows = rows_of([run_of(job, progress) for job in jobs], words, threshold)
    return Tradeoff(command, points, threshold, machine(), rows)


if __name__ == "__main__":
    sys.exit(main())
