"""`room2dgs prepare`: poses, points and metres for a video or a folder of photos."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.short_keys import FOOTAGE, with_full_keys
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.logs import to_terminal
from room2dgs.pipeline.prepare import prepare_capture
from room2dgs.runs.folder import absolute, last_value

USAGE = "room2dgs prepare video=FILE|images=DIR out=DIR [prepare.KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Choose sharp frames, match them, find the cameras' poses and sparse points, turn the room upright, bring it to
    metres, and say what should be filmed again.

    `out` then holds images/, sparse/0/ (COLMAP's layout), prepare.json (the verdict) and camera_path.png;
    `room2dgs run scene.path=OUT out=DIR` goes on. Stopped at any time, the same command goes on after the last
    finished stage. out/work may be deleted at the end.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("prepare",))
    overrides = with_full_keys(argv, FOOTAGE)
    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR, where the capture goes")
    if last_value(overrides, "scene.path"):
        raise InputError("scene.path has poses already; give video=FILE or images=DIR")
    config = absolute(load_config([*overrides, f"scene.path={out}"]))
    prepare_capture(config, Path(config.out))
    to_terminal(f"go on with: room2dgs run scene.path={config.out} out=DIR")
    return 0
