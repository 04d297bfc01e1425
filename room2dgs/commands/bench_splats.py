"""`room2dgs bench splats CAPTURE...`: quality of splats against seconds, ours and another program's."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from room2dgs.commands.bench_prior import split_scenes
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commit import commit
from room2dgs.errors import InputError
from room2dgs.report.table import terminal
from room2dgs.runs.folder import last_value
from room2dgs.runs.metrics import machine, versions

USAGE = "room2dgs bench splats CAPTURE... out=DIR [methods=2d,3d] [seconds=60] [other=NAME:DIR] [KEY=VALUE]"
HELP = """Trains splats of several kinds on captures, and notes how good the held-out views are after so many seconds.

For example: room2dgs bench splats room out=bench methods=2d,3d,3d_mcmc seconds=30,60,120 train.iterations=3000
Each method runs in a process of its own, in out/<capture>/<method>. The table is printed, and written to out as
bench_splats.csv, .json and, with curves, .html. Results of another program are scored by the same code:
other=NAME:DIR, a folder with SECONDS.ply (3D Gaussians in the capture's world) or folders SECONDS of pictures named as
the held-out photos are, of each capture in a folder of its name if there are several.
"""
OURS = ("methods", "seconds", "other", "out", "resume", "scene.path")
SECONDS = "30,60,120,300,900"


def main(argv: list[str] | None = None) -> int:
    """Train, note, print the table, write the report.

    Raises:
        InputError: settings that cannot be, an unknown method, a capture without held-out views.
    """
    argv = list(argv or [])
    if asked_for_help(argv):
        return show(argv, USAGE, HELP + _methods_help(), ("scene", "train"))
    from room2dgs.bench.splats import measured
    from room2dgs.bench.splats_other import other_points, parsed
    from room2dgs.bench.splats_report import points_table, write_report
    from room2dgs.config import load_config
    from room2dgs.pipeline.scene import read_capture

    out = last_value(argv, "out")
    if not out:
        raise InputError("out is not given; add out=DIR")
    settings = [text for text in argv if text.partition("=")[0] not in OURS]
    captures, settings = split_scenes(settings)
    methods, marks = chosen_methods(last_value(argv, "methods")), chosen_seconds(last_value(argv, "seconds") or SECONDS)
    others = [parsed(text.partition("=")[2]) for text in argv if text.startswith("other=")]
    about: dict[str, Any] = {
        "command": shlex.join(["room2dgs", "bench", "splats", *argv]),
        "machine": machine(), "commit": commit(), "versions": versions(), "settings": settings,
    }  # fmt: skip
    points = []
    for capture in captures:  # a wrong folder is reported before the first is trained on
        config = load_config([*settings, f"scene.path={capture}", "out=unused"])
        scene = read_capture(config)
        if not scene.test:
            raise InputError(f"{capture}: no view is held out (scene.test_every={config.scene.test_every})")
        for other in others:
            points += other_points(other, Path(capture).name, scene, config)
    for found in measured(captures, methods, marks, Path(out), settings, print):
        points += found
        write_report(Path(out), points, about)
    write_report(Path(out), points, about)
    print(terminal(points_table(points)))
    print(f"report: {Path(out) / 'bench_splats.html'}")
    return 0


def chosen_methods(text: str | None) -> list[str]:
    """Names of methods, apart by commas; "none": none, for `other` alone.

    Raises:
        InputError: there is no such method.
    """
    from room2dgs.bench.splats import DEFAULT_METHODS, METHODS

    names = list(DEFAULT_METHODS) if text is None else [name for name in text.split(",") if name and name != "none"]
    for name in names:
        if name not in METHODS:
            raise InputError(f"methods={name} is not known; choose from {', '.join(METHODS)}")
    return names


def chosen_seconds(text: str) -> Sequence[float]:
    """Moments of training, rising.

    Raises:
        InputError: they are no numbers above 0.
    """
    try:
        marks = sorted({float(part) for part in text.split(",")})
    except ValueError:
        marks = []
    if not marks or not all(math.isfinite(mark) and mark > 0 for mark in marks):
        raise InputError(f"seconds={text} is not understood; write seconds=30,60,120")
    return marks


def _methods_help() -> str:
    from room2dgs.bench.splats import METHODS

    width = max(map(len, METHODS))
    return "\nmethods:\n" + "".join(f"  {name:<{width}}  {what}\n" for name, (_, what) in METHODS.items())
