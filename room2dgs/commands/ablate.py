"""`room2dgs ablate`: the method without each of its parts, as one table with pictures."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from room2dgs.commands.eval import ground_truth
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import read
from room2dgs.errors import RunFailed
from room2dgs.logs import run_log
from room2dgs.runs.metrics import earlier
from room2dgs.study.ablation import Run, Study, rows_of
from room2dgs.study.jobs import Job, batches, executed, finished, planned, study_folder, words_of
from room2dgs.study.launch import of_hydra

USAGE = (
    "room2dgs ablate scene.path=DIR out=DIR [experiment=full,no_seed,...] [train.seed=0,1,2] [KEY=A,B,...] "
    "[hydra/launcher=joblib]"
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
        return show(USAGE, main.__doc__)
    out = study_folder(argv, JSON)
    hydra_settings = [text for text in argv if of_hydra(text)]
    settings = [text for text in argv if text.partition("=")[0] not in OURS and text not in hydra_settings]
    jobs = planned([*DEFAULTS, *settings], out)
    todo = [job for job in jobs if not job.same_as and not finished(job)]
    config = jobs[0].config
    gt = ground_truth(config)
    scene = read(config)  # reported now if missing, not once a row
    from room2dgs.study.ablation_report import HTML, MARKDOWN, write_page, write_tables

    out.mkdir(parents=True, exist_ok=True)
    log = run_log(out)
    command = shlex.join(["room2dgs", "ablate", *argv])
    failed: dict[Path, RunFailed] = {}
    text = write_tables(_study(jobs, todo, failed, command), out)  # first: it marks the folder as a study's
    log(f"{command}\n{len(jobs)} runs, {len(jobs) - len(todo)} of them finished before or the same as another")
    for batch in batches(todo, hydra_settings):
        todo = [job for job in todo if job not in batch]
        for job in batch:
            log(f"\n{job.row}, seed {job.seed}, {len(todo)} more to come: {job.folder}")
        for job, failure in zip(batch, executed(batch, hydra_settings, out), strict=True):
            if failure:
                failed[job.folder] = failure
                log(f"{job.row}, seed {job.seed}, failed: {failure}")
        text = write_tables(_study(jobs, todo, failed, command), out)
    log(f"\n{text}")
    write_page(_study(jobs, todo, failed, command), out, scene, gt or scene.gt_mesh)
    log(f"tables: {out / MARKDOWN}, with pictures: {out / HTML}")
    return next((failure.code for failure in failed.values()), 0)


def _study(jobs: Sequence[Job], todo: Sequence[Job], failed: Mapping[Path, RunFailed], command: str) -> Study:
    """The table so far."""
    by_run = {(job.row, job.seed): job for job in jobs}
    runs = []
    for job in jobs:
        made = by_run[job.same_as or job.row, job.seed]
        why = str(failed.get(made.folder, ""))
        metrics = None if why or made in todo else earlier(made.folder)
        runs.append(Run(job.row, job.seed, made.folder, metrics, why, job.same_as))
    words = {job.row: words_of(job.experiment) + job.row.removeprefix(job.experiment) for job in jobs}
    config = jobs[0].config
    rows = rows_of(runs, words, config.eval.threshold_m)
    return Study(f"Ablation of {Path(config.scene.path).name}", command, config.eval.threshold_m, rows)
