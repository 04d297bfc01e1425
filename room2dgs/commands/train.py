"""`room2dgs train`: sparse points and training, without the mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.captures.scene import Scene
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import cached, points_and_priors, read, refined, use_threads
from room2dgs.config import Config
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import claimed, new_run
from room2dgs.runs.metrics import peak_memory_mb, record, stale, timed

if TYPE_CHECKING:
    from room2dgs.train import Hook

# of the surfels before a run went on
IMAGE_SCORES = ("psnr_db", "ssim", "test_views")
USAGE = "room2dgs train scene.path=DIR out=DIR [resume=true] [KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Train on a capture, or go on with a run."""
    if asked_for_help(argv):
        return show(USAGE, main.__doc__)
    config = new_run(argv)
    seconds: dict[str, float] = {}
    with timed(seconds, "read"):
        scene = read(config, keep=True)
    with claimed(config) as out, cached(scene, out):
        log = run_log(out)
        scene = refined(scene, config, out, log, seconds)
        train_scene(scene, config, out, log, seconds)
        log(f"peak memory {peak_memory_mb() / 1000:.2f} GB")
        log(f"next: room2dgs mesh out={out}")
    return 0


def train_scene(scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float]) -> None:
    """Points, priors and training into the run's folder, their figures into its metrics.json."""
    from room2dgs.train import train

    use_threads(config)
    watchers = _watchers(config)
    points, priors = points_and_priors(scene, config, out, log, seconds)
    with timed(seconds, "train"):
        result = train(scene, points, config, out, log, priors.by_frame, watchers)
        scene.cache.clear()  # nothing after the training wants maps, and photos are read again
    # The loop's own clock also has what an interrupted run took before it was resumed.
    seconds["train"] = max(seconds["train"], round(sum(result.seconds.values()), 3))
    part: dict[str, Any] = {
        **stale(out, IMAGE_SCORES),
        "primitives": result.surfels,
        "seeds": result.seeds,
        "iterations": result.iterations,
        "training_seconds": result.seconds,
    }
    record(out, part, seconds)


def _watchers(config: Config) -> list[Hook]:
    if not config.train.viewer:
        return []
    from room2dgs.viewer.hook import ShowTraining

    return [ShowTraining()]
