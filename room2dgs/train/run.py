"""Training from photos and sparse points to a file of surfels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.logs import Log, run_log
from room2dgs.torch_threads import one_torch_thread
from room2dgs.train.corrections import PoseCorrections
from room2dgs.train.device import on_device
from room2dgs.train.fingerprint import digest
from room2dgs.train.finite_checks import FiniteCheck
from room2dgs.train.hooks import Checkpoints, Densification, HeldOut, Neighbours
from room2dgs.train.report import Report
from room2dgs.train.strategies.registry import new_strategy
from room2dgs.train.surfel_file import save_surfels
from room2dgs.train.thinning import Thinning
from room2dgs.train.trainer import Hook, Trainer


@dataclass(frozen=True)
class TrainResult:
    """What training leaves.

    Attributes:
        surfels_path: out/surfels.safetensors (`load_surfels` reads it).
        surfels, seeds: their numbers.
        iterations: done in all, earlier runs included.
        seconds: by stage of the iteration (progress.STAGES), earlier runs included.
        losses: means over the last logged stretch: each unweighted term, "loss", "psnr_db"; empty if
            there was nothing left to do.
        test_psnr_db: of the held-out views when they were last rendered; None if they were not.
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
    hooks: Sequence[Hook] = (),
    bar: bool = True,
) -> TrainResult:
    """Optimise surfels for `config.train.iterations`; with `config.resume`, from the last whole checkpoint.

    The same scene, points, settings and hooks give the same bits on the same machine, on any number of threads,
    whether or not the run was killed and resumed in between.

    Args:
        scene: at least one training view.
        points: sparse points; not used when a checkpoint is resumed.
        config: settings.
        out: the run's folder; takes checkpoints/, surfels.safetensors and tensorboard/.
        log: takes one line at a time; None: standard output and out/log.txt.
        priors: depth and normals predicted for training views, by frame name; views without train without.
        hooks: more of them (see `trainer.Hook`), called after densification and before reports and checkpoints.
        bar: whether a terminal gets a bar.

    Raises:
        InputError: no usable points, a photo that cannot be decoded, a full disk, no GPU where one is asked for, or a
            resumed run whose settings, views or priors differ from the first one's.
        RuntimeError: a loss or gradient that is not finite (our fault).
    """
    out, report = Path(out), Report(bar)
    first = (Neighbours(), Densification(new_strategy(config, scene)), *_thinning(config), *_corrections(config))
    last = (FiniteCheck(), HeldOut(), report, Checkpoints())
    with on_device(config.render.device) as device:
        trainer = Trainer(scene, points, config, out, log or run_log(out), priors, (*first, *hooks, *last), device)
        trainer.run()
        model, surfels = trainer.model, trainer.surfels()

    path = out / "surfels.safetensors"
    meta = {
        "iteration": model.iteration,
        "sh_degree": config.render.sh_degree,
        "background": list(config.render.background),
        "near_m": config.render.near_m,
        "seeds": model.seeds,
        "settings": digest(trainer.fingerprint),
    }
    save_surfels(path, surfels, meta)
    return TrainResult(
        surfels_path=path,
        surfels=len(surfels.centers),
        seeds=model.seeds,
        iterations=model.iteration,
        seconds=dict(trainer.clock.seconds),
        losses=report.losses,
        test_psnr_db=report.test_psnr_db,
    )


def _thinning(config: Config) -> list[Hook]:
    return [Thinning()] if config.strategy.thin > 0 else []


def _corrections(config: Config) -> list[Hook]:
    return [PoseCorrections()] if config.train.refine_poses else []
