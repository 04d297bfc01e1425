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
    """A log for the run in `out`: lines go to stdout and out/log.txt.

    What modules send to the logger meanwhile goes to the run that was last heard of: a study's runs may follow each
    other in one process.
    """
    path = Path(out) / LOG_FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    handler = _RunHandler(path)

    def log(line: str) -> None:
        _use(handler)
        LOGGER.info(line)

    _use(handler)
    return log


def logged(out: Path) -> list[str]:
    """Lines of the log of the run in `out`; none where it cannot be read."""
    try:
        return (out / LOG_FILE).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []


def open_log() -> Path | None:
    """The log file of the run in this process, if there is one."""
    return next((handler.path for handler in _run_handlers() if handler.path.exists()), None)


def _use(handler: _RunHandler) -> None:
    """Make it the one run handler of the logger."""
    for other in _run_handlers():
        if other is not handler:
            LOGGER.removeHandler(other)
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
    LOGGER.propagate = False  # a root handler, such as Hydra's, would print each line again


def _run_handlers() -> list[_RunHandler]:
    return [handler for handler in LOGGER.handlers if isinstance(handler, _RunHandler)]
