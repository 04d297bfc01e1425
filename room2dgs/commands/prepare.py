"""`room2dgs prepare`: poses, points and metres for a video or a folder of photos."""

from __future__ import annotations

import shutil
from pathlib import Path

from room2dgs.blame import by_the_machine
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.short_keys import written_out
from room2dgs.config import Config, load_config
from room2dgs.errors import InputError
from room2dgs.files import is_temporary, remove_leftovers
from room2dgs.logs import LOG_FILE, run_log, to_terminal
from room2dgs.owner import LOCK, owned
from room2dgs.runs.folder import CAPTURE, absolute, check_out, last_value

USAGE = "room2dgs prepare video=FILE|images=DIR out=DIR [prepare.KEY=VALUE ...]"
SHORT = {"video": "prepare.video", "images": "prepare.images"}
WORK, IMAGES = "work", "images"


def main(argv: list[str]) -> int:
    """Choose sharp frames, match them, find the cameras' poses and sparse points, turn the room upright, bring it to
    metres, and say what should be filmed again.

    `out` then holds images/, sparse/0/ (COLMAP's layout), prepare.json (the verdict) and camera_path.png;
    `room2dgs run scene.path=OUT out=DIR` goes on. Stopped at any time, the same command goes on after the last
    finished stage. out/work may be deleted at the end.
    """
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("prepare",))
    overrides = written_out(argv, SHORT)
    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR, where the capture goes")
    if last_value(overrides, "scene.path"):
        raise InputError("scene.path has poses already; give video=FILE or images=DIR")
    config = absolute(load_config([*overrides, f"scene.path={out}"]))
    prepared(config, Path(config.out))
    to_terminal(f"go on with: room2dgs run scene.path={config.out} out=DIR")
    return 0


def with_capture(overrides: list[str]) -> list[str]:
    """For `run`: a video's or a folder's settings with the path of the capture that is made of it in the run's folder.

    Raises:
        InputError: as `prepared`, or settings that cannot be.
    """
    if not any(last_value(overrides, key) for key in SHORT.values()):
        return overrides
    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR")
    if last_value(overrides, "scene.path"):
        raise InputError("scene.path has poses already; give either that or video=FILE or images=DIR")
    result = [*overrides, f"scene.path={Path(out).expanduser().absolute() / CAPTURE}"]
    config = absolute(load_config(result))
    check_out(Path(config.out), config.resume)
    with owned(Path(config.out)):
        prepared(config, Path(config.scene.path))
    return result


def prepared(config: Config, out: Path) -> None:
    """The capture in `out`, as far as it is not there.

    Raises:
        InputError: as `room2dgs.prepare.prepare.prepare`, or `out` is taken.
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
            prepare(config, out, run_log(out))
        except InputError as error:
            if not by_the_machine(error) and not any((out / WORK).iterdir()):  # nothing that a second try could use
                for name in {WORK, IMAGES} - there:
                    shutil.rmtree(out / name, ignore_errors=True)
                if LOG_FILE not in there:
                    (out / LOG_FILE).unlink(missing_ok=True)
            raise


def _check_place(out: Path) -> None:
    if not out.exists() or (out / WORK).is_dir():
        return
    if any(path.name != LOCK and not is_temporary(path.name) for path in out.iterdir()):
        raise InputError(f"{out} is not empty and holds no capture that was being prepared; choose another out=DIR")
