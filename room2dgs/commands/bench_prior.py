"""`room2dgs bench prior SCENE...`: how good a prior is where depth is known, and what a run makes of its depth."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from room2dgs.bench.prior import in_words, is_simulated, measured_scenes
from room2dgs.bench.prior_in_run import depth_in_run
from room2dgs.bench.prior_report import HTML, MARKDOWN, NOTES, sentences, tables, write_report
from room2dgs.bench.prior_views import EXACT
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commit import commit
from room2dgs.config import Config, load_config
from room2dgs.cores import available_cores
from room2dgs.errors import InputError
from room2dgs.report.table import terminal
from room2dgs.runs.folder import absolute, last_value
from room2dgs.runs.metrics import machine, versions

USAGE = "room2dgs bench prior SCENE... [out=DIR] [in_run=true] [scene.frames=N] [KEY=VALUE ...]"
HELP = """Measures depth, normals, confidence and time of the configured prior on captures with depth, or on made rooms.

For example: room2dgs bench prior room other_room out=report prior/depth=tcmonodepth prior.depth.model=FILE
It prints tables; with out=DIR it writes them as bench_prior.json, bench_prior.md and, with pictures, bench_prior.html.
With in_run=true it also does to the depth maps of each capture what a run does (minutes a scene).
"""
IN_RUN = {"in_run=true": True, "in_run=false": False}


def main(argv: list[str] | None = None) -> int:
    """Measure, print tables, write the report where `out` says.

    Raises:
        InputError: settings that cannot be, no prior, a scene without depth.
    """
    argv = list(argv or [])
    if asked_for_help(argv):
        return show(argv, USAGE, HELP, ("scene", "prior"))
    in_run = any([IN_RUN[text] for text in argv if text in IN_RUN][-1:])
    scenes, overrides = split_scenes([text for text in argv if text not in IN_RUN])
    given = last_value(overrides, "out")
    configs = [scene_config(scene, overrides) for scene in scenes]
    prior, out = configs[0].prior, configs[0].out if given else ""
    if out and Path(out).exists() and not Path(out).is_dir():
        raise InputError(f"{out} is a file; choose another out=DIR")
    scores = measured_scenes([config.scene for config in configs], prior)
    if in_run:
        for score, config in zip(scores, configs, strict=True):
            score.in_run = {} if score.truth == EXACT else depth_in_run(config, print)
    about: dict[str, Any] = {
        "command": shlex.join(["room2dgs", "bench", "prior", *argv]),
        "prior": in_words(prior),
        "simulated": is_simulated(prior),
        "settings": dataclasses.asdict(prior),
        "threads": prior.threads or available_cores(),
        "machine": machine(),
        "commit": commit(),
        "versions": versions(),
        "notes": NOTES,
    }
    for text in (*sentences(about), *map(terminal, tables(scores))):
        print(text)
    if out:
        write_report(Path(out), scores, about)
        print(f"report: {Path(out) / MARKDOWN}, with pictures: {Path(out) / HTML}")
    return 0


def split_scenes(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """The folders and the settings among the arguments.

    Raises:
        InputError: no folder is named, or something is neither.
    """
    scenes = [text for text in argv if "=" not in text or Path(text).expanduser().is_dir()]
    unknown = next((text for text in scenes if text.startswith("-")), None)
    if unknown:
        raise InputError(f"{unknown!r} is not understood; settings are written KEY=VALUE")
    if not scenes:
        raise InputError("no scene is given; name the folder of a capture with depth")
    return scenes, [text for text in argv if text not in scenes]


def scene_config(scene: str, overrides: Sequence[str]) -> Config:
    """The settings for one scene, all of whose frames count.

    Raises:
        InputError: settings that cannot be.
    """

    rest = [f"scene.path={scene}", "scene.test_every=0"]
    given = ["prior=room_prior", *overrides] if not any(text.startswith("prior=") for text in overrides) else overrides
    return absolute(load_config([*given, *rest, *([] if last_value(list(overrides), "out") else ["out=unused"])]))
