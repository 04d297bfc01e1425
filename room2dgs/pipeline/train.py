"""Training of the surfels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.depth import points_and_priors
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import load_run_surfels, use_threads
from room2dgs.runs.metrics import IMAGE_SCORES, cleared

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats
    from room2dgs.train import Hook


def train_surfels(scene: Scene, config: Config, run: RunFolder) -> Splats:
    """Points, priors and training; checkpoints and surfels go to the run's folder, figures to its metrics.json.

    Raises:
        InputError: as `points_and_priors` and `train`.
    """
    from room2dgs.train import train

    use_threads(config)
    watchers = _watchers(config)
    points, priors = points_and_priors(scene, config, run)
    with run.timed("train"):
        result = train(scene, points, config, run.path, run.log, priors.by_frame, watchers)
        scene.cache.clear()  # nothing after the training wants maps, and photos are read again
    # The loop's own clock also has what an interrupted run took before it was resumed.
    run.times["train"] = max(run.times["train"], round(sum(result.seconds.values()), 3))
    run.record(
        {
            **cleared(run.path, IMAGE_SCORES),
            "primitives": result.surfels,
            "seeds": result.seeds,
            "iterations": result.iterations,
            "training_seconds": result.seconds,
        }
    )
    return load_run_surfels(run.path)


def _watchers(config: Config) -> list[Hook]:
    if not config.train.viewer:
        return []
    from room2dgs.viewer.hook import ShowTraining

    return [ShowTraining()]
