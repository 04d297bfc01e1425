"""A study's runs, one after the other or as a launcher has it, with what failed on the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from room2dgs.errors import RunFailed
from room2dgs.files import remove_leftovers
from room2dgs.logs import Log, in_lines
from room2dgs.owner import owned
from room2dgs.runs.metrics import read_metrics
from room2dgs.study.ablation import Run
from room2dgs.study.jobs import Job, batches, executed


@dataclass
class Progress:
    """How far a study is.

    Attributes:
        todo: runs that are not finished.
        failed: folder -> why its run failed.
    """

    todo: list[Job]
    failed: dict[Path, RunFailed] = field(default_factory=dict)

    @property
    def code(self) -> int:
        """0, or the exit code of the first failed run's cause."""
        return next((failure.code for failure in self.failed.values()), 0)


def run_all(
    progress: Progress,
    jobs: Sequence[Job],
    hydra_settings: Sequence[str],
    out: Path,
    log: Log,
    after_each: Callable[[], object],
) -> None:
    """Runs those of the jobs that are to do.

    Args:
        after_each: called whenever some have ended, to write what is known by then.

    Raises:
        KeyboardInterrupt: one was interrupted.
        InputError: another process works in `out`.
    """
    with owned(out):  # each job owns its own folder in it
        remove_leftovers(out, owned=True)
        for batch in batches([job for job in jobs if job in progress.todo], hydra_settings):
            for job in batch:
                progress.todo.remove(job)
                in_lines(log, f"\n{job.row}, seed {job.seed}, {len(progress.todo)} more to come: {job.folder}")
            for job, failure in zip(batch, executed(batch, hydra_settings, out), strict=True):
                if failure:
                    progress.failed[job.folder] = failure
                    log(f"{job.row}, seed {job.seed}, failed: {failure}")
            after_each()


def run_of(job: Job, progress: Progress) -> Run:
    """A job as the tables know it."""
    why = str(progress.failed.get(job.folder, ""))
    metrics = None if why or job in progress.todo else read_metrics(job.folder)
    return Run(job.row, job.seed, job.folder, metrics, why)
