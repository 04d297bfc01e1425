"""Refining the poses of a capture: poses.json."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import describe_capture, with_poses_of_run
from room2dgs.pipeline.unit_estimate import estimated_unit
from room2dgs.runs.folder import CHECKPOINTS, POINTS, POSES, PRIOR_MAPS
from room2dgs.runs.metrics import read_metrics


def refine_poses(scene: Scene, config: Config, run: RunFolder, *, with_priors: bool = True) -> Scene:
    """The capture with the poses that a new or resumed run works with, in metres; poses.json keeps them.

    A run that has a checkpoint goes on with the poses that it has. Before that, frames or settings may have changed
    since the run was begun; what has stayed the same is in the cache of points.

    Args:
        with_priors: networks make their maps meanwhile, since matching of photos leaves cores free.

    Raises:
        InputError: as `refined_poses` and `read_poses`.
    """
    from room2dgs.captures.in_metres import in_metres
    from room2dgs.captures.poses_file import write_poses
    from room2dgs.depth.network.ahead import maps_ahead
    from room2dgs.sfm.refinement import refined_poses

    describe_capture(scene, run)
    if any((run.path / CHECKPOINTS).glob("*")):
        found = with_poses_of_run(scene, run.path)
        _record_origin(scene, found, run)
        return found
    known = (run.path / POSES).exists()
    cache = Path(config.points.cache or run.path / POINTS)
    prior = replace(config.prior, cache=config.prior.cache or str(run.path / PRIOR_MAPS))
    ahead = maps_ahead(scene.keyframes, prior, run.log) if with_priors else nullcontext(lambda: None)
    in_cm = scene.metric or config.scene.given_unit is not None
    # poses that are there took their time when they were found
    with nullcontext() if known else run.timed("poses"), ahead as begin:
        found, report = refined_poses(scene, config.sfm, config.points, cache, run.log, begin, in_cm)
    unit = estimated_unit(found, config, run, with_priors=with_priors)
    if unit is not None:
        given, scene, found = scene, in_metres(scene, unit), in_metres(found, unit)
        _record_origin(given, found, run)
        if report.get("moved_m") is not None:
            report = {**report, "moved_m": unit.metres * report["moved_m"]}
            if report["refined"]:
                run.log(f"poses: by this unit the cameras moved {100 * report['moved_m']:.1f} cm (median)")
    write_poses(run.path / POSES, scene, found, report, unit)
    run.record({"poses": report})
    return found


def _record_origin(given: Scene, found: Scene, run: RunFolder) -> None:
    """Puts the origin in metres in the place of the capture's, where an estimated unit changed it."""
    if found.origin_m != given.origin_m:
        run.record({"capture": {**read_metrics(run.path)["capture"], "origin_m": list(found.origin_m)}})
