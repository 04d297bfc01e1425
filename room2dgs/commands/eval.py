"""`room2dgs eval`: scores of a run's mesh and held-out views, or of any mesh."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.short_keys import with_full_keys
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.pipeline.evaluate import evaluate_mesh, evaluate_run, ground_truth
from room2dgs.pipeline.loaded_run import loaded_run
from room2dgs.runs.folder import CONFIG, absolute, earlier_run, last_value

USAGE = "room2dgs eval run=DIR | pred=MESH [gt=MESH] scene=DIR [out=DIR] [eval.KEY=VALUE ...]"
SHORT = {"pred": "eval.pred", "gt": "eval.gt", "scene": "scene.path", "run": "out"}


def main(argv: list[str]) -> int:
    """Score an earlier run, or any mesh against a ground truth seen by a capture's cameras."""
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("scene", "eval"))
    overrides = with_full_keys(argv, SHORT)
    out = last_value(overrides, "out")
    if not out or not (Path(out).expanduser() / CONFIG).is_file():
        evaluate_mesh(absolute(load_config(_with_folder(overrides, out))))
        return 0
    config = earlier_run(overrides)
    ground_truth(config)
    with loaded_run(config) as (scene, surfels, run):
        evaluate_run(scene, surfels, config, run)
    return 0


def _with_folder(overrides: list[str], out: str | None) -> list[str]:
    """The settings of a mesh that no run made, with a folder beside it for the scores unless one is given."""
    pred = last_value(overrides, "eval.pred")
    if not pred:
        raise InputError("nothing to score; give out=DIR of an earlier run, or pred=MESH scene=DIR")
    path = Path(pred).expanduser()
    return overrides if out else [*overrides, f"out={path.with_name(path.stem + '_scores')}"]
