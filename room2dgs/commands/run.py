"""`room2dgs run`: the main job, from photos to a scored mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from room2dgs.captures.scene import Scene
from room2dgs.commands.eval import ground_truth, score_run
from room2dgs.commands.export import export_after_run
from room2dgs.commands.mesh import mesh_scene
from room2dgs.commands.mesh_of_depth import mesh_of_depth
from room2dgs.commands.mesh_of_points import mesh_of_points
from room2dgs.commands.mesh_of_stereo import mesh_of_stereo
from room2dgs.commands.prepare import SHORT, with_capture
from room2dgs.commands.render import render_scene
from room2dgs.commands.report import report_scene
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.short_keys import written_out
from room2dgs.commands.stages import cached, read, refined, trained_surfels
from room2dgs.commands.train import train_scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import CONFIG, MESH, RENDERS, REPORT, claimed, last_value, new_run
from room2dgs.runs.metrics import Stages, earlier, timed

USAGE = (
    "room2dgs run scene.path=DIR out=DIR [resume=true] [KEY=VALUE ...]\n"
    "room2dgs run video=FILE|images=DIR out=DIR [resume=true] [KEY=VALUE ...]\n"
    "room2dgs run -m scene.path=DIR,DIR out=DIR [hydra/launcher=joblib] [KEY=VALUE,VALUE ...]"
)
MULTIRUN = ("-m", "--multirun")
# mesh.source -> what makes mesh.ply without training
UNTRAINED = {"depth": mesh_of_depth, "stereo": mesh_of_stereo, "points": mesh_of_points}


def main(argv: list[str]) -> int:
    """Points, training, mesh, renders of the held-out views, scores if there is a ground truth, and a report.

    mesh.source=depth trains nothing: a first mesh of the depth that stereo, the network or the sensor gives. Nor do
    mesh.source=stereo, of stereo's depth alone, and mesh.source=points, of the sparse points alone; both read no prior.

    With -m every combination of settings that are lists is a run of its own, in out/0, out/1, ...: Hydra's multirun,
    with Hydra's sweepers and launchers. A path with a comma in its name then stands in quotes.

    Of a video, or of photos without poses, a capture is made first, in out/capture: see `room2dgs prepare --help`.
    """
    if asked_for_help(argv):
        return show(USAGE, main.__doc__)
    if any(text in MULTIRUN for text in argv):
        return _swept([text for text in argv if text not in MULTIRUN])
    config = new_run(with_capture(written_out(argv, SHORT)))
    ground_truth(config)  # reported now if missing, not after the training
    seconds = Stages()
    with timed(seconds, "read"):
        scene = read(config, keep=True)
    with claimed(config) as out, cached(scene, out):
        log = run_log(out)
        scene = refined(scene, config, out, log, seconds, with_priors=config.mesh.with_priors)
        if not config.mesh.of_surfels:
            UNTRAINED[config.mesh.source](scene, config, out, log, seconds)
            score_run(scene, None, config, out, seconds)
            if config.report.enabled:
                report_scene(scene, None, config, out, log, seconds)
        else:
            _train_and_show(scene, config, out, log, seconds)
        log("")
        for line in summary(out, earlier(out)):
            log(line)
    return 0


def _train_and_show(scene: Scene, config: Config, out: Path, log: Log, seconds: Stages) -> None:
    """Everything that needs surfels."""
    train_scene(scene, config, out, log, seconds)
    surfels = trained_surfels(out)
    mesh_scene(scene, surfels, config, out, log, seconds)
    export_after_run(scene, surfels, config, log, seconds)
    render_scene(scene, surfels, config, out, log, seconds)
    score_run(scene, surfels, config, out, seconds)
    if config.report.enabled:
        report_scene(scene, surfels, config, out, log, seconds)


def _swept(overrides: list[str]) -> int:
    from room2dgs.study.launch import multirun

    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR, in which each run gets a folder of its own")
    folder = Path(out).expanduser().absolute()
    if (folder / CONFIG).exists():
        raise InputError(f"{folder} holds a run; choose another out=DIR for several")
    multirun([text for text in overrides if not text.startswith("out=")], folder)
    return 0


def summary(out: Path, metrics: dict[str, Any]) -> list[str]:
    """The run in a few lines: how good, how long, where to look."""
    lines = []
    scores = [metrics.get(f"{name}_5cm") for name in ("f_score", "precision", "recall")]
    if None not in scores:
        lines.append("F-score @ 5 cm {:.3f} (precision {:.3f}, recall {:.3f})".format(*scores))
    seconds = metrics["seconds"]
    stages = ", ".join(f"{stage} {value:.0f} s" for stage, value in seconds.items())
    surfels = f"{metrics['primitives']:,} surfels; " if metrics.get("primitives") is not None else ""
    lines.append(f"{surfels}{sum(seconds.values()):.0f} s in all: {stages}")
    lines.append(f"peak memory {metrics['peak_memory_mb'] / 1000:.2f} GB")
    lines.append(f"mesh      {out / MESH}")
    if (out / RENDERS).exists():
        lines.append(f"pictures  {out / RENDERS}")
    if (out / "eval" / "views.png").exists():
        lines.append(f"          {out / 'eval' / 'views.png'}, {out / 'eval' / 'top.png'}")
    if (out / REPORT).exists():
        lines.append(f"report    {out / REPORT}")
    return lines
