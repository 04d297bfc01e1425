"""From a capture to a scored mesh: all steps of a run, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, load_config
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.owner import owned
from room2dgs.pipeline.depth import points_and_priors
from room2dgs.pipeline.evaluate import evaluate_run, ground_truth
from room2dgs.pipeline.export import export_after_run
from room2dgs.pipeline.exposure import with_even_exposure
from room2dgs.pipeline.mesh import make_mesh
from room2dgs.pipeline.poses import refine_poses
from room2dgs.pipeline.prepare import FOOTAGE, prepare_capture
from room2dgs.pipeline.progress import PREPARE_S, USUAL_MP, USUAL_PHOTOS, Progress, expected_seconds, listed_photos
from room2dgs.pipeline.render import write_renders
from room2dgs.pipeline.report import write_run_report
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import photos_cached, read_capture
from room2dgs.pipeline.summary import summary
from room2dgs.pipeline.train import train_surfels, training_hooks
from room2dgs.pipeline.verdict import judge_run
from room2dgs.runs.folder import CAPTURE, absolute, check_out, claimed, last_value, new_run
from room2dgs.runs.metrics import StageTimes, timed

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats
    from room2dgs.train import Hook


def start_run(overrides: Sequence[str], show: Log | None = None, progress: Progress | None = None) -> Path:
    """A new run, or one that goes on, from its first step to its last.

    Args:
        overrides: "KEY=VALUE" each, as they are typed after `room2dgs run`.
        show: takes the lines of the log one at a time; None: they go to the standard output.
        progress: is told how far the run is, which is then shown in place of the training's own bar; None: nobody is.

    Returns:
        The run's folder.

    Raises:
        InputError: settings that cannot be, a folder that holds something else, or as the steps.
    """
    watched = progress or Progress()
    config = new_run(with_capture(list(overrides), show, watched))
    ground_truth(config)  # reported now if missing, not after the training
    times = StageTimes(watched.begin)
    watched.expect(expected_seconds(config, listed_photos(config), USUAL_MP))
    with timed(times, "read"):
        scene = read_capture(config, keep_photos=True)
    first = scene.frames[0].camera
    watched.expect(expected_seconds(config, len(scene.frames), first.width * first.height / 1e6))
    with claimed(config) as out, photos_cached(scene, out):
        run = RunFolder.with_log(out, times, show, bar=progress is None)
        run_steps(scene, config, run)
        run.log("")
        for line in summary(out):
            run.log(line)
    return out


def run_steps(scene: Scene, config: Config, run: RunFolder) -> None:
    """The method: poses, depth and training, mesh, and what is made of them.

    Args:
        scene: with the poses that the capture brings.

    Raises:
        InputError: as the steps.
    """
    scene = refine_poses(scene, config, run, with_priors=config.mesh.with_priors)
    surfels = train_steps(scene, config, run) if config.mesh.of_surfels else None
    make_mesh(scene, surfels, config, run)
    if surfels is not None:
        export_after_run(scene, surfels, config, run)
        write_renders(scene, surfels, config, run)
    evaluate_run(scene, surfels, config, run)
    judge_run(scene, config, run)
    if config.report.enabled:
        write_run_report(scene, surfels, config, run)


def train_steps(scene: Scene, config: Config, run: RunFolder, more: Sequence[Hook] = ()) -> Splats:
    """Points, depth and training.

    Args:
        scene: with the poses to train with.
        more: hooks beside those of the settings.

    Raises:
        InputError: as the steps.
    """
    hooks = [*training_hooks(config), *more]  # reported now if a library is missing, not after hours of work
    points, priors = points_and_priors(scene, config, run)
    scene = with_even_exposure(scene, points, priors.by_frame, config, run)
    return train_surfels(scene, points, priors, config, run, hooks)


def start_training(overrides: Sequence[str], show: Log | None = None) -> RunFolder:
    """The first steps of a run, up to its surfels; see `start_run`."""
    config = new_run(list(overrides))
    times = StageTimes()
    with timed(times, "read"):
        scene = read_capture(config, keep_photos=True)
    with claimed(config) as out, photos_cached(scene, out):
        run = RunFolder.with_log(out, times, show)
        train_steps(refine_poses(scene, config, run), config, run)
    return run


def with_capture(overrides: list[str], show: Log | None = None, progress: Progress | None = None) -> list[str]:
    """Makes the capture of a video or of photos in the run's folder, and adds its path to the settings.

    Raises:
        InputError: as `prepare_capture`, or settings that cannot be.
    """
    if not any(last_value(overrides, key) for key in FOOTAGE):
        return overrides
    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR")
    if last_value(overrides, "scene.path"):
        raise InputError("scene.path has poses already; give either that or video=FILE or images=DIR")
    result = [*overrides, f"scene.path={Path(out).expanduser().absolute() / CAPTURE}"]
    config = absolute(load_config(result))
    check_out(Path(config.out), config.resume)
    if progress is not None:
        progress.begin("prepare")
        progress.expect({"prepare": PREPARE_S} | expected_seconds(config, USUAL_PHOTOS, USUAL_MP))
    with owned(Path(config.out)):
        prepare_capture(config, Path(config.scene.path), show)
    return result
