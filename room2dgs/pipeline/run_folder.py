"""The folder that the steps of a run write to."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from room2dgs.logs import Log, run_log
from room2dgs.runs.metrics import StageTimes, record, timed


@dataclass(frozen=True)
class RunFolder:
    """A folder, what is said of the work in it, and how long that took.

    Attributes:
        path: the folder.
        log: takes one line at a time.
        times: seconds by stage, since this object was made.
        bar: whether the training may show a bar on a terminal.
    """

    path: Path
    log: Log = print
    times: StageTimes = field(default_factory=StageTimes)
    bar: bool = True

    @classmethod
    def with_log(
        cls, path: Path, times: StageTimes | None = None, show: Log | None = None, bar: bool = True
    ) -> RunFolder:
        """One that keeps its log in log.txt.

        Args:
            times: of stages before; None: of none.
            show: takes the lines as well, one at a time; None: the standard output does.
            bar: as the attribute.

        Raises:
            InputError: as `run_log`.
        """
        return cls(path, run_log(path, show), StageTimes() if times is None else times, bar)

    def timed(self, stage: str) -> AbstractContextManager[None]:
        """Adds the block's time to that of a stage."""
        return timed(self.times, stage)

    def record(self, figures: dict[str, Any] | None = None) -> None:
        """Sets figures in metrics.json, and the times so far.

        Raises:
            InputError: metrics.json is damaged.
        """
        record(self.path, figures or {}, self.times)
