"""`room2dgs ablate`: the method without each of its parts, as one table with pictures."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.logs import in_lines, run_log
from room2dgs.pipeline.evaluate import ground_truth
from room2dgs.pipeline.scene import read_capture
from room2dgs.study.ablation import Study, rows_of
from room2dgs.study.jobs import Job, finished, planned, study_folder, words_of
from room2dgs.study.launch import of_hydra
from room2dgs.study.progress import Progress, run_all, run_of

USAGE = (
    "room2dgs ablate scene.path=DIR out=DIR [experiment=full,no_seed,...] [train.seed=0,1,2]\n"
    "                [KEY=A,B,...] [hydra/launcher=joblib]"
)
DEFAULTS = (
    "train.seed=0,1,2",  # slowest: every row has one run before any has two
    "experiment=full,no_seed,no_depth,no_normal,no_mv,no_distortion",
    "prior=room_prior",  # papers compare what photos alone give; a capture's own depth, if asked for: prior=auto
)
OURS = ("out", "resume")
JSON = "ablation.json"


def main(argv: list[str]) -> int:
    """Run every combination of settings that are lists, and compare: a table, whether the paper's ordering
    holds, and pictures of the error side by side.

    Each run is a `room2dgs run` in out/<experiment>/seed_<n>. What is finished is not run again: after a kill or
    a failure the same command goes on. A failed run is named in the table, and the others go on; the exit code is
    that of the first one's cause. Hydra's launcher starts the runs: hydra/launcher=joblib, several at a time.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__)
    out = study_folder(argv, JSON)
    hydra_settings = [text for text in argv if of_hydra(text)]
    settings = [text for text in argv if text.partition("=")[0] not in OURS and text not in hydra_settings]
    jobs = planned([*DEFAULTS, *settings], out)
    progress = Progress([job for job in jobs if not job.same_as and not finished(job)])
    config = jobs[0].config
    gt = ground_truth(config)
    scene = read_capture(config)  # reported now if missing, not once a row
    from room2dgs.study.ablation_report import HTML, MARKDOWN, write_page, write_tables

    out.mkdir(parents=True, exist_ok=True)
    log = run_log(out)
    command = shlex.join(["room2dgs", "ablate", *argv])

    def write() -> str:
        return write_tables(_study(jobs, progress, command), out)

    write()  # first: it marks the folder as a study's
    in_lines(
        log,
        f"{command}\n{len(jobs)} runs, {len(jobs) - len(progress.todo)} of them finished before or the same as another",
    )
    run_all(progress, jobs, hydra_settings, out, log, write)
    in_lines(log, f"\n{write()}")
    write_page(_study(jobs, progress, command), out, scene, gt or scene.gt_mesh)
    log(f"tables: {out / MARKDOWN}, with pictures: {out / HTML}")
    return progress.code


def _study(jobs: Sequence[Job], progress: Progress, command: str) -> Study:
    """The table so far."""
    by_run = {(job.row, job.seed): job for job in jobs}
    runs = [
        replace(run_of(by_run[job.same_as or job.row, job.seed], progress), row=job.row, same_as=job.same_as)
        for job in jobs
    ]
    words = {job.row: words_of(job.experiment) + job.row.removeprefix(job.experiment) for job in jobs}
    config = jobs[0].config
    rows = rows_of(runs, words, config.eval.threshold_m)
    return Study(f"Ablation of {Path(config.scene.path).name}", command, config.eval.threshold_m, rows)
