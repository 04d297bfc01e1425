"""`room2dgs bench suite DIR...`: the same settings on several captures, as one table."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from room2dgs.commands.bench_prior import split_scenes
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.logs import in_lines, run_log
from room2dgs.runs.metrics import machine
from room2dgs.study.jobs import Job, finished, study_folder
from room2dgs.study.launch import of_hydra
from room2dgs.study.progress import Progress, run_all, run_of
from room2dgs.study.scene_lists import expanded
from room2dgs.study.suite import JSON, MARKDOWN, Suite, planned, rows_so_far, write_tables

USAGE = (
    "room2dgs bench suite DIR...|scenes=LIST root=DIR out=DIR [train.seed=0,1] [KEY=VALUE ...] [hydra/launcher=joblib]"
)
OURS = ("out", "resume")


def main(argv: list[str]) -> int:
    """Run each capture with the same settings and print one table: scores, seconds, memory, and their means.

    Captures with an even number at the end of their name are the half to tune on, those with an odd one the half to
    report. Each run is a `room2dgs run` in out/<capture>/seed_<n>. What is finished is not run again: after a kill or
    a failure the same command goes on. A failed run is named in the table, and the others go on; the exit code is
    that of the first one's cause. The tables are suite.md and suite.json in `out`. scenes=scannet_paper,
    scannetpp_paper or scannet_manhattan stands for the scenes of papers in the folder root.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__)
    out = study_folder(argv, JSON)
    hydra_settings = [text for text in argv if of_hydra(text)]
    rest = [text for text in argv if text.partition("=")[0] not in OURS and text not in hydra_settings]
    scenes, settings = split_scenes(expanded(rest))
    jobs = planned(scenes, settings, out)
    progress = Progress([job for job in jobs if not finished(job)])
    out.mkdir(parents=True, exist_ok=True)
    log = run_log(out)
    command = shlex.join(["room2dgs", "bench", "suite", *argv])

    def write() -> str:
        return write_tables(_suite(jobs, progress, command, settings), out)

    write()  # first: it marks the folder as a study's
    in_lines(log, f"{command}\n{len(jobs)} runs, {len(jobs) - len(progress.todo)} of them finished before")
    run_all(progress, jobs, hydra_settings, out, log, write)
    in_lines(log, f"\n{write()}")
    log(f"tables: {out / MARKDOWN}, {out / JSON}")
    return progress.code


def _suite(jobs: Sequence[Job], progress: Progress, command: str, settings: Sequence[str]) -> Suite:
    """The table so far."""
    threshold = jobs[0].config.eval.threshold_m
    rows = rows_so_far([run_of(job, progress) for job in jobs], threshold)
    return Suite(command, tuple(settings), threshold, machine(), rows)
