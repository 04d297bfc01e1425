"""Log lines, and a bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

Log = Callable[[str], None]
REFRESH = 10  # iterations between two updates of the bar


def file_log(out: Path) -> Log:
    """Lines to the standard output and, appended, to out/log.txt."""
    path = Path(out) / "log.txt"
    path.parent.mkdir(parents=True, exist_ok=True)

    def log(line: str) -> None:
        print(line, flush=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")

    return log


class Bar:
    """A progress bar on a terminal; nothing elsewhere, where the log lines do."""

    def __init__(self, total: int, done: int) -> None:
        self._progress: Progress | None = None
        if sys.stderr.isatty():
            columns = [
                BarColumn(20),
                "{task.completed}/{task.total}",
                TimeRemainingColumn(),
                "{task.fields[figures]}",
            ]
            self._progress = Progress(
                *(TextColumn(c) if isinstance(c, str) else c for c in columns),
                console=Console(stderr=True),
                refresh_per_second=4,
            )
            self._task = self._progress.add_task("training", total=total, completed=done, figures="")

    def start(self) -> None:
        if self._progress:
            self._progress.start()

    def stop(self) -> None:
        if self._progress:
            self._progress.stop()

    def update(self, done: int, figures: str) -> None:
        """Show `done` iterations and the last figures; cheap enough for every iteration."""
        if self._progress and done % REFRESH == 0:
            self._progress.update(self._task, completed=done, figures=figures)
