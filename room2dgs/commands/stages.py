"""What several commands do with a run: read its capture, load its surfels, render its views."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.commands.units import note_scale
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.runs.folder import (
    CACHE,
    CHECKPOINTS,
    CONFIG,
    KEPT,
    POINTS,
    POSES,
    PRIOR_MAPS,
    PRIORS,
    SURFELS,
    TRUST,
    required,
    saved_settings,
)
from room2dgs.runs.metrics import Stages, by_stage, record, timed

if TYPE_CHECKING:  # torch takes seconds to import, and a wrong path should be reported at once
    from room2dgs.depth import Priors
    from room2dgs.sfm.sparse import MayLack
    from room2dgs.splat.types import Rendering, Surfels


def read(config: Config, keep: bool = False) -> Scene:
    """The capture.

    Args:
        keep: the photos, decoded, as far as memory.cache_mb allows: for commands that use them all.

    Raises:
        InputError: as `read_scene`.
    """
    from room2dgs.captures.cache import Cache
    from room2dgs.captures.read import read_scene

    return read_scene(config.scene, Cache(config.memory.cache_mb) if keep else None)


def refined(
    scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float], *, with_priors: bool = True
) -> Scene:
    """The capture with the poses that a new or resumed run works with; out/poses.json keeps them.

    A run that has a checkpoint goes on with its poses. Before that, other frames or settings may be asked for; what has
    stayed the same is in the cache of points.

    Args:
        with_priors: networks make their maps meanwhile, since matching of photos leaves cores free.

    Raises:
        InputError: as `refined_poses` and `read_poses`.
    """
    from room2dgs.captures.poses_file import write_poses
    from room2dgs.depth.network.ahead import maps_ahead
    from room2dgs.sfm.refinement import refined_poses

    told(scene, out, log)
    if any((out / CHECKPOINTS).glob("*")):
        return with_poses_of_run(scene, out)
    known = (out / POSES).exists()
    cache = Path(config.points.cache or out / POINTS)
    prior = with_map_cache(config, out).prior
    ahead = maps_ahead(scene.keyframes, prior, log) if with_priors else nullcontext(lambda: None)
    # what was found before took its time then
    with nullcontext() if known else timed(seconds, "poses"), ahead as begin:
        found, report = refined_poses(scene, config.sfm, config.points, cache, log, extracted=begin)
    write_poses(out / POSES, scene, found, report)
    record(out, {"poses": report}, seconds)
    return found


def told(scene: Scene, out: Path, log: Log) -> None:
    """How the capture was understood, into the log and out/metrics.json, before anything is made of it."""
    for note in scene.notes:
        log(note)
    for warning in scene.warnings:
        log(f"WARNING: {warning}")
    for dropped in scene.dropped:
        log(f"frame {dropped.name} left out: {dropped.reason}")
    about = {
        "layout": scene.layout,
        "metric": scene.metric,
        "origin_m": list(scene.origin_m),
        "warnings": list(scene.warnings),
        "left_out": {dropped.name: dropped.reason for dropped in scene.dropped},
    }
    record(out, {"capture": about}, {})


def with_poses_of_run(scene: Scene, out: Path) -> Scene:
    """The capture with the poses that the run in `out` worked with.

    Raises:
        InputError: as `read_poses`.
    """
    from room2dgs.captures.poses_file import read_poses

    return read_poses(out / POSES, scene)[0] if (out / POSES).exists() else scene


@contextmanager
def cached(scene: Scene, out: Path) -> Iterator[None]:
    """What the scene's cache has no room for lies in the run's folder, until the block ends."""
    scene.cache.use_folder(out / CACHE)
    try:
        yield
    finally:
        scene.cache.clear()


def use_threads(config: Config) -> None:
    """The kernels' threads from now on; torch and open3d keep their own."""
    from room2dgs.splat import set_threads

    set_threads(config.render.threads)


def points_of_run(
    scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float], **options: Any
) -> PointCloud:
    """The sparse points; those that are triangulated lie in the run's folder unless the settings say where.

    Args:
        options: `may_lack` and `instead` of `sparse_points`.

    Raises:
        InputError: as `sparse_points`.
    """
    from room2dgs.sfm.sparse import sparse_points

    with timed(seconds, "points"):
        return sparse_points(scene, config.points, Path(config.points.cache or out / POINTS), log, **options)


def points_and_priors(
    scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float]
) -> tuple[PointCloud, Priors]:
    """What is known of the surfaces before anything is trained; what it is goes to out/metrics.json.

    Raises:
        InputError: as `sparse_points` and `read_priors`.
    """
    from room2dgs.runs.kept_priors import keep_priors, key_of

    some = f", {len(scene.keyframes)} of them keyframes" if scene.beside else ""
    log(f"{len(scene.train)} training views{some}, {len(scene.test)} held out")
    points = points_of_run(scene, config, out, log, seconds, may_lack=points_may_lack(config))
    key = key_of(scene, points, config)
    priors = _kept(scene, key, out)
    if priors is None:
        with timed(seconds, "priors"):
            priors = read_priors(scene, points, config, out, log)
            keep_priors(out / KEPT, key, priors, log)
    else:  # which took its time then
        log("priors are there from before")
        note_scale(priors, points, scene, config, out, log)
    part = {
        "points": len(points),
        "priors": priors.label,
        "depth_source": priors.depth_source,
        "prior_networks": priors.networks,
    }
    record(out, part, seconds)
    return points, priors


def _kept(scene: Scene, key: str, out: Path) -> Priors | None:
    """What `read_priors` gave before the run was killed, if all is there that it writes."""
    from room2dgs.runs.kept_priors import kept_priors

    priors = kept_priors(out / KEPT, key, scene)
    if priors is None or (priors.fits and not (out / PRIORS).exists()):
        return None
    has_depth = any(maps.depth is not None for maps in priors.by_frame.values())
    return priors if (out / TRUST).exists() or not has_depth else None


def knows_metres(config: Config) -> bool:
    """Whether a prior gives depth in metres, whatever the photos say of it."""
    return config.prior.depth.source != "none" and config.prior.depth.meaning == "metric_depth"


def points_may_lack(config: Config) -> MayLack:
    """Whether a run goes on without sparse points."""
    from room2dgs.sfm.sparse import MayLack

    return MayLack.WITH_METRES if knows_metres(config) else MayLack.NEVER


def with_map_cache(config: Config, out: Path) -> Config:
    """The networks' maps lie in the run's folder unless the settings say where."""
    return replace(config, prior=replace(config.prior, cache=config.prior.cache or str(out / PRIOR_MAPS)))


def read_priors(scene: Scene, points: PointCloud, config: Config, out: Path, log: Log) -> Priors:
    """Priors of the keyframes; how each depth map was aligned goes to out/priors.csv, how far it is trusted to
    out/trust.npz.

    Raises:
        InputError: as `estimate_depth`.
    """
    from room2dgs.depth import estimate_depth
    from room2dgs.files import whole_file
    from room2dgs.report.csv_text import csv_lines
    from room2dgs.runs.trust import write_trust

    seconds = Stages()
    priors = estimate_depth(scene, points, config, out / PRIOR_MAPS, log, partial(timed, seconds))
    covered = [float((depth > 0).mean()) for depth, _ in priors.stereo.values()]
    share = round(sum(covered) / len(covered), 4) if covered else None
    record(out, {"prior_seconds": by_stage(seconds), "stereo_coverage": share}, {})
    write_trust(out / TRUST, scene.keyframes, priors.by_frame, priors.stereo)
    note_scale(priors, points, scene, config, out, log)
    if priors.fits:
        rows = [("view", "scale", "shift", "median_relative_residual", "points")]
        for name, fit in priors.fits.items():
            rows.append((name, f"{fit.scale:.6g}", f"{fit.shift:.6g}", f"{fit.residual:.4f}", fit.points))
        with whole_file(out / PRIORS) as temporary:
            temporary.write_text(csv_lines(rows), encoding="utf-8")
    return priors


def trained_surfels(out: Path) -> Surfels:
    """The surfels of a run.

    Raises:
        InputError: it trained nothing, or not to the end, or the file is damaged.
    """
    from room2dgs.train import load_surfels

    return load_surfels(surfels_of_run(out))


def surfels_of_run(out: Path) -> Path:
    """Their file.

    Raises:
        InputError: the run trained nothing, or not to the end.
    """
    if not (out / SURFELS).is_file() and (out / CONFIG).is_file():
        source = saved_settings(out).mesh.source
        if source != "surfels":
            raise InputError(
                f"{out} has no surfels: mesh.source={source} trains nothing; start another run without it, in another "
                "out=DIR"
            )
    return required(out / SURFELS, "train")


def rendered(
    surfels: Surfels, frames: Iterable[Frame], config: Config, device: str = "cpu"
) -> Iterator[tuple[Frame, Rendering]]:
    """Each view's rendering, one at a time, at the size that the run works at.

    Args:
        device: as `render.device`; the images stay where they are drawn.

    Raises:
        InputError: no GPU where one is asked for.
    """
    import torch

    from room2dgs.geometry.camera_tensors import view_matrices
    from room2dgs.splat import render
    from room2dgs.train.device import moved, on_device

    with on_device(device) as where:
        there = moved(surfels, where)
        background = moved(torch.tensor(config.render.background, dtype=torch.float32), where)
    for frame in frames:
        camera = frame.camera
        matrices = (moved(matrix, where) for matrix in view_matrices(camera))
        with on_device(device), torch.no_grad():  # around the call alone: a generator would leave it on in its caller
            view = render(there, *matrices, *camera.size, background=background, near_m=config.render.near_m)
        yield frame, view
