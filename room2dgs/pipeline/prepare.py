"""A capture of a video or a folder of photos."""

from __future__ import annotations

import shutil
from pathlib import Path

from room2dgs.blame import by_the_machine
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.files import is_temporary, remove_leftovers
from room2dgs.logs import LOG_FILE, Log, run_log
from room2dgs.owner import LOCK, owned

FOOTAGE = ("prepare.video", "prepare.images")  # settings that name what a capture is made of
WORK, IMAGES = "work", "images"


def prepare_capture(config: Config, out: Path, show: Log | None = None) -> None:
    """Makes the capture in `out`, as far as it is not there.

    Args:
        config: `prepare.video` or `prepare.images` is what it is made of.
        show: takes the lines of the log one at a time; None: they go to the standard output.

    Raises:
        InputError: as `room2dgs.prepare.prepare.prepare`, or something else lies in `out`.
    """
    settings = config.prepare
    if bool(settings.video) == bool(settings.images):
        both = " and not both" if settings.video else ""
        raise InputError(f"give video=FILE or images=DIR{both}")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; choose another out=DIR")
    _check_place(out)
    from room2dgs.prepare.prepare import prepare

    with owned(out):
        _check_place(out)  # again: somebody may have been faster
        there = {path.name for path in out.iterdir()}
        try:
            (out / WORK).mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
        for folder in (out, out / WORK):
            remove_leftovers(folder, owned=True)
        try:
            prepare(config, out, run_log(out, show))
        except InputError as error:
            if not by_the_machine(error) and not any((out / WORK).iterdir()):  # nothing that a second try could use
                _remove_made(out, there)
            raise


def _check_place(out: Path) -> None:
    if not out.exists() or (out / WORK).is_dir():
        return
    if any(path.name != LOCK and not is_temporary(path.name) for path in out.iterdir()):
        raise InputError(f"{out} is not empty and holds no capture that was being prepared; choose another out=DIR")


def _remove_made(out: Path, there: set[str]) -> None:
    """Without what a capture that came to nothing has made; `there` was in the folder before."""
    for name in {WORK, IMAGES} - there:
        shutil.rmtree(out / name, ignore_errors=True)
    if LOG_FILE not in there:
        (out / LOG_FILE).unlink(missing_ok=True)
