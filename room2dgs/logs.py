"""Log lines, by Python's `logging`: the logger "room2dgs", to the standard output and to a run's log.txt."""

from __future__ import annotations

import errno
import logging
import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path

from room2dgs.errors import InputError
from room2dgs.links_out import refuse_links_out
from room2dgs.regular_files import open_regular
from room2dgs.texts import shown

Log = Callable[[str], None]  # takes one line
LOGGER = logging.getLogger("room2dgs")
LOG_FILE = "log.txt"
LONGEST = 16 << 20  # bytes of a log that are read; a run of a day has one


class _RunHandler(logging.Handler):
    """Plain lines to what shows them, such as the standard output, and, appended, to a file.

    Each is one line, with control characters escaped: names in it may be anybody's.
    """

    def __init__(self, path: Path, show: Log) -> None:
        super().__init__()
        self.path = path
        self.show = show

    def emit(self, record: logging.LogRecord) -> None:
        # errors reach the caller, unlike those of logging's own handlers: a full disk ends a run with its sentence
        line = self.format(record)
        self.show(line)
        append(self.path, shown(line) + "\n")


def run_log(out: Path | str, show: Log | None = None) -> Log:
    """A log for the run in `out`: lines go to out/log.txt and to `show`, or else to the standard output.

    What modules send to the logger meanwhile goes to the run that was last heard of: a study's runs may follow each
    other in one process.

    Raises:
        InputError: a link leads out of the folder.
    """
    path = Path(out) / LOG_FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    refuse_links_out(path.parent)
    handler = _RunHandler(path, show or to_terminal)

    def log(line: str) -> None:
        _use(handler)
        LOGGER.info(line)

    _use(handler)
    return log


def to_terminal(line: str) -> None:
    """One line to the standard output, with control characters escaped: for commands that keep no log."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    print(shown(line).encode(encoding, "backslashreplace").decode(encoding), flush=True)


def in_lines(log: Log, text: str) -> None:
    """Our own text of several lines, such as a table; what others wrote in it is escaped by then."""
    for line in text.split("\n"):
        log(line)


def append(path: Path, text: str) -> None:
    """Text to the end of a log, which is made if needed; no link is followed, no pipe waited for.

    Raises:
        InputError: something else than a file lies in its place.
        OSError: the disk refuses.
    """
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        handle = os.open(path, flags, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENXIO):
            raise InputError(f"{path} is no file of a log; delete it") from error
        raise
    with os.fdopen(handle, "a", encoding="utf-8", errors="backslashreplace") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise InputError(f"{path} is no file of a log; delete it")
        file.write(text)


def logged(out: Path) -> list[str]:
    """Lines of the log of the run in `out`, as far as `LONGEST` bytes; none where it cannot be read."""
    try:
        with open_regular(out / LOG_FILE) as file:
            text = file.read(LONGEST).decode("utf-8", errors="replace")
    except (OSError, InputError):
        return []
    return text.splitlines()


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
