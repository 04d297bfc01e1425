"""What dense stereo finds where depth is known, and what it costs.

python -m room2dgs.tools.stereo_check SCENE...
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pandas as pd

from room2dgs.commands.bench_prior import scene_config, split_scenes
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commit import commit
from room2dgs.errors import InputError
from room2dgs.report.csv_text import as_csv_text
from room2dgs.runs.folder import last_value
from room2dgs.runs.metrics import machine
from room2dgs.tools.command_line import command_line
from room2dgs.tools.stereo_check.scores import measured

USAGE = (
    "python -m room2dgs.tools.stereo_check SCENE... [out=DIR] [widths=320,640] [scene.frames=N] [stereo.KEY=VALUE ...]"
)
HELP = """Measures dense stereo on captures with depth: how much of it is found and right, and how long a photo takes.

For example: python -m room2dgs.tools.stereo_check room other_room widths=320
It says what share of the pixels is kept, how many of these are within 2 and 5 cm, their relative error, and seconds a
photo; how much faster all threads are than one (on some of the photos); and how many times as long a sweep takes as the
bare loop of the same comparisons. With out=DIR the sparse points are kept there, and the table is written as
stereo.csv.
"""
WIDTHS = "widths="


@command_line("stereo_check")
def main(argv: list[str]) -> int:
    """Measure and print a table.

    Raises:
        InputError: settings that cannot be, a scene without depth.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, HELP, ("scene", "stereo"))
    lists = [part.removeprefix(WIDTHS).split(",") for part in argv if part.startswith(WIDTHS)]
    widths: list[int | None] = [_width(text) for texts in lists for text in texts]
    scenes, overrides = split_scenes([text for text in argv if not text.startswith(WIDTHS)])
    rows = []
    for scene in scenes:
        config = scene_config(scene, overrides)
        for width in widths or [config.stereo.width]:
            rows.append(measured(config, width))
    table = pd.DataFrame(rows)
    print(shlex.join(["python", "-m", "room2dgs.tools.stereo_check", *argv]))
    print(f"{machine()}; commit {commit()}")
    print(table.to_string(index=False))
    if last_value(overrides, "out"):
        path = Path(scene_config(scenes[0], overrides).out) / "stereo.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(as_csv_text(table), encoding="utf-8")
        print(f"table: {path}")
    return 0


def _width(text: str) -> int:
    if not text.isdecimal() or int(text) < 16:
        raise InputError(f"widths={text} is no list of image widths; give for example widths=320,640")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
