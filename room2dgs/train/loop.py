"""The training loop: photos and sparse points to surfels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.files import remove_leftovers
from room2dgs.torch_threads import one_torch_thread
from room2dgs.train import checkpoint
from room2dgs.train.clock import StageClock
from room2dgs.train.fingerprint import check_same, digest, fingerprint
from room2dgs.train.model import Model, checkpoint_of, new_model, restored_model
from room2dgs.train.neighbour_views import NeighbourViews
from room2dgs.train.progress import Log, file_log
from room2dgs.train.report import Report
from room2dgs.train.schedule import image_fraction, view_index
from room2dgs.train.step import current_surfels, iterate, mean_psnr_db
from room2dgs.train.strategies.base import Strategy
from room2dgs.train.strategies.registry import new_strategy
from room2dgs.train.surfel_file import save_surfels
from room2dgs.train.views import Views

STRATEGY, MULTIVIEW = "strategy", "multiview"  # in `Checkpoint.extra`


@dataclass(frozen=True)
class TrainResult:
    """What training leaves.

    Attributes:
        surfels_path: out/surfels.safetensors (`load_surfels` reads it).
        surfels, seeds: their numbers.
        iterations: done in all, earlier runs included.
        seconds: by stage of the iteration (clock.STAGES), earlier runs included.
        losses: means over the last logged stretch: each unweighted term, "loss", "psnr_db"; empty if
            there was nothing left to do.
        test_psnr_db: of the held-out views at the last look; None without one.
    """

    surfels_path: Path
    surfels: int
    seeds: int
    iterations: int
    seconds: dict[str, float]
    losses: dict[str, float]
    test_psnr_db: float | None


@one_torch_thread()
def train(
    scene: Scene,
    points: PointCloud,
    config: Config,
    out: Path | str,
    log: Log | None = None,
    priors: Mapping[str, ViewMaps] | None = None,
) -> TrainResult:
    """Optimise surfels for `config.train.iterations`; with `config.resume`, from the last whole checkpoint.

    The same scene, points and settings give the same bits on the same machine, on any number of threads,
    whether or not the run was killed and resumed in between.

    Args:
        scene: at least one training view.
        points: sparse points; not looked at when a checkpoint is resumed.
        config: settings.
        out: the run's folder; takes checkpoints/, surfels.safetensors and tensorboard/.
        log: takes one line at a time; None: standard output and out/log.txt.
        priors: depth and normals predicted for training views, by frame name; views without train without.

    Raises:
        InputError: no usable points, a photo that cannot be decoded, a full disk, or a resumed run
            whose settings, views or priors differ from the first one's.
        RuntimeError: a loss or gradient that is not finite (our fault).
    """
    out = Path(out)
    log = log or file_log(out)
    identity = fingerprint(config, scene, priors)
    strategy = new_strategy(config, scene)
    neighbour_views = NeighbourViews(Views(scene.train, priors, scene.cache), config)
    model, clock = _start(scene, points, priors, config, out, identity, strategy, neighbour_views, log)
    with Report(out, config.train, model.iteration, log) as report:
        _optimise(model, strategy, scene, neighbour_views, config, out, identity, clock, report)

    surfels = current_surfels(model, config.render)
    path = out / "surfels.safetensors"
    meta = {
        "iteration": model.iteration,
        "sh_degree": config.render.sh_degree,
        "background": list(config.render.background),
        "near_m": config.render.near_m,
        "seeds": model.seeds,
        "settings": digest(identity),
    }
    save_surfels(path, surfels, meta)
    return TrainResult(
        surfels_path=path,
        surfels=len(surfels.centers),
        seeds=model.seeds,
        iterations=model.iteration,
        seconds=dict(clock.seconds),
        losses=report.losses,
        test_psnr_db=report.test_psnr_db,
    )


def _start(
    scene: Scene,
    points: PointCloud,
    priors: Mapping[str, ViewMaps] | None,
    config: Config,
    out: Path,
    identity: dict[str, Any],
    strategy: Strategy,
    neighbour_views: NeighbourViews,
    log: Log,
) -> tuple[Model, StageClock]:
    """The model to go on with, and the time it took so far; strategy and neighbours take up their states."""
    remove_leftovers(checkpoint.folder_of(out))
    state = checkpoint.latest(out, log) if config.resume else None
    if state:
        check_same(state.fingerprint, identity, out)
        log(f"resuming after iteration {state.iteration} of {config.train.iterations}")
        strategy.load(_part(state.extra, STRATEGY))
        neighbour_views.load(_part(state.extra, MULTIVIEW), state.iteration)
        return restored_model(state, config), StageClock(state.seconds)
    if config.resume:
        log(f"no whole checkpoint in {checkpoint.folder_of(out)}; starting from the beginning")
    model = new_model(scene, points, config, priors)
    log(f"{len(points)} points, {model.seeds} seeds, {model.surfel_count} surfels, {len(scene.train)} training views")
    return model, StageClock()


def _optimise(
    model: Model,
    strategy: Strategy,
    scene: Scene,
    neighbour_views: NeighbourViews,
    config: Config,
    out: Path,
    identity: dict[str, Any],
    clock: StageClock,
    report: Report,
) -> None:
    settings = config.train
    views, held_out = neighbour_views.views, Views(scene.test, cache=scene.cache)
    extent = scene.extent
    # a run from the beginning takes the place of an earlier one, once it has a checkpoint of its own
    kept = checkpoint.up_to(out, model.iteration) if model.iteration else []
    while model.iteration < settings.iterations:
        clock.start()
        index = view_index(model.iteration, len(views), settings.seed)
        view = views.at(index, image_fraction(model.iteration, settings.resolutions))
        watched = strategy.before_backward(model.iteration)
        pair = neighbour_views.pair(model.iteration, index)
        step = iterate(model, view, config, extent, clock, watched, pair)
        neighbour_views.keep(model.iteration - 1, index, step.depth, step.alpha)
        if watched:
            strategy.after_backward(step)
        adjustment = strategy.after_step(model)
        clock.lap("strategy")
        done, last = model.iteration, model.iteration == settings.iterations
        report.step(done, step, model.surfel_count)
        if adjustment:
            report.adjusted(done, adjustment, model.seeds)
        if settings.test_every and len(held_out) and (done % settings.test_every == 0 or last):
            report.test(done, mean_psnr_db(model, held_out, config.render))
        if done % settings.checkpoint_every == 0 or last:
            states = {STRATEGY: strategy.state(), MULTIVIEW: neighbour_views.state()}
            extra = {f"{owner}/{name}": value for owner, state in states.items() for name, value in state.items()}
            kept.append(checkpoint.save(out, checkpoint_of(model, identity, clock.seconds, extra)))
            kept = kept[-settings.keep_checkpoints :]
            checkpoint.keep_only(out, kept)


def _part(extra: dict[str, Tensor], owner: str) -> dict[str, Tensor]:
    """One owner's tensors by their own names."""
    return {name.removeprefix(f"{owner}/"): v for name, v in extra.items() if name.startswith(f"{owner}/")}
