"""Log lines, by Python's `logging`: the logger "room2dgs", to the standard output and to a run's log.txt."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

Log = Callable[[str], None]  # takes one line
LOGGER = logging.getLogger("room2dgs")
LOG_FILE = "log.txt"


class _RunHandler(logging.Handler):
    """Plain lines to what the standard output is at that time, and, appended, to a file."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path

    def emit(self, record: logging.LogRecord) -> None:
        # errors reach the caller, unlike those of logging's own handlers: a full disk ends a run with its sentence
        line = self.format(record)
        print(line, flush=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def run_log(out: Path | str) -> Log:
    """A log for the run in `out`, from now on the one run of this process; lines go to stdout and out/log.txt."""
    path = Path(out) / LOG_FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    for handler in _run_handlers():
        LOGGER.removeHandler(handler)
    LOGGER.addHandler(_RunHandler(path))
    LOGGER.setLevel(logging.INFO)
    LOGGER.propagate = False  # a root handler, such as Hydra's, would print each line again
    return LOGGER.info


def open_log() -> Path | None:
    """The log file of the run in this process, if there is one."""
    return next((handler.path for handler in _run_handlers() if handler.path.exists()), None)


def _run_handlers() -> list[_RunHandler]:
    return [handler for handler in LOGGER.handlers if isinstance(handler, _RunHandler)]
