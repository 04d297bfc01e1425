"""Training of the surfels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import load_run_surfels, use_threads
from room2dgs.runs.metrics import IMAGE_SCORES, cleared

if TYPE_CHECKING:
    from room2dgs.depth import Priors
    from room2dgs.primitives.primitive import Splats
    from room2dgs.train import Hook


def train_surfels(
    scene: Scene,
    points: PointCloud,
    priors: Priors,
    config: Config,
    run: RunFolder,
    hooks: Sequence[Hook] | None = None,
) -> Splats:
    """Trains; checkpoints and surfels go to the run's folder, figures to its metrics.json.

    Args:
        scene: with the poses to train with.
        points, priors: as `points_and_priors` gives them.
        hooks: what is called in each iteration; None: those of `training_hooks`.

    Returns:
        The surfels as they are in the file, in the scene's frame.

    Raises:
        InputError: as `train`.
    """
    from room2dgs.primitives.registry import new_primitive
    from room2dgs.train import train

    use_threads(config)
    hooks = training_hooks(config) if hooks is None else hooks
    with run.timed("train"):
        result = train(scene, points, config, run.path, run.log, priors.by_frame, hooks, run.bar)
        scene.cache.clear()  # nothing after the training wants maps, and photos are read again
    # The loop's own clock also has what an interrupted run took before it was resumed.
    run.times["train"] = max(run.times["train"], round(sum(result.seconds.values()), 3))
    run.record(
        {
            **cleared(run.path, IMAGE_SCORES),
            "primitives": result.surfels,
            "primitives_called": new_primitive(config).called,
            "seeds": result.seeds,
            "iterations": result.iterations,
            "training_seconds": result.seconds,
        }
    )
    return load_run_surfels(run.path)


def training_hooks(config: Config) -> list[Hook]:
    """What the settings want to be called in each iteration.

    Raises:
        InputError: train.viewer is on, and a library is missing.
    """
    if not config.train.viewer:
        return []
    from room2dgs.viewer.hook import ShowTraining

    return [ShowTraining()]
