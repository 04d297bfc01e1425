"""Expected against true errors of every source of depth and normals.

python -m room2dgs.tools.calibration SCENE...
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

from room2dgs.commands.bench_prior import scene_config, split_scenes
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commit import commit
from room2dgs.errors import InputError
from room2dgs.report.table import markdown, terminal
from room2dgs.runs.folder import last_value
from room2dgs.runs.metrics import machine
from room2dgs.tools.calibration.bins import Calibration
from room2dgs.tools.calibration.report import DRAWING, MARKDOWN, NOTES, tables, write_calibration
from room2dgs.tools.calibration.sources import calibrations
from room2dgs.tools.command_line import command_line

USAGE = "python -m room2dgs.tools.calibration SCENE... [out=DIR] [scene.frames=N] [KEY=VALUE ...]"
HELP = """Measures on captures with depth whether expected errors of depth and normals are right in size.

For example: python -m room2dgs.tools.calibration room other_room out=report scene.frames=36 scene.image_width=320
It compares the photos, aligns and completes the network's depth as a run does, and prints, for stereo, the network,
completed depth (where stereo, planes or neither hold it) and the depth camera, bins of the expected error with the true
ones and the share of the pixels. With out=DIR it writes them as calibration.json, .md and, drawn, .png, and keeps
the sparse points and the network's maps there.
"""


@command_line("calibration")
def main(argv: list[str]) -> int:
    """Measure, print tables, write them where `out` says.

    Raises:
        InputError: settings that cannot be, a scene without depth.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, HELP, ("scene", "stereo", "prior"))
    scenes, overrides = split_scenes(argv)
    given = last_value(overrides, "out")
    configs = [scene_config(scene, overrides) for scene in scenes]
    out = configs[0].out if given else ""
    if out and Path(out).exists() and not Path(out).is_dir():
        raise InputError(f"{out} is a file; choose another out=DIR")
    found: dict[str, list[Calibration]] = {}
    truths: dict[str, str] = {}
    for config in configs:
        config.out = out
        name = _name(Path(config.scene.path), found)
        truths[name], found[name] = calibrations(config, print)
    about: dict[str, Any] = {
        "command": shlex.join(["python", "-m", "room2dgs.tools.calibration", *argv]),
        "truth_of_normals": truths,
        "machine": machine(),
        "commit": commit(),
    }
    words = [f"{about['command']}; commit {about['commit']}", *NOTES]
    shown = tables(found)
    print("\n\n".join([*words, *map(terminal, shown)]))
    if out:
        text = "\n\n".join(["# Calibration", *words, *map(markdown, shown)]) + "\n"
        write_calibration(Path(out), found, about, text)
        print(f"tables: {Path(out) / MARKDOWN}, drawn: {Path(out) / DRAWING}")
    return 0


def _name(path: Path, taken: dict[str, list[Calibration]]) -> str:
    """The folder's name, with its parent's where another capture has it already."""
    return path.name if path.name not in taken else f"{path.parent.name}/{path.name}"


if __name__ == "__main__":
    sys.exit(main())
