"""The unit of poses that have no metres, by the depth prior: all that comes after works in metres."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.in_metres import MEND, EstimatedUnit, in_metres, scaled_camera, scaled_points
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import Config
from room2dgs.pipeline.points import gives_metres, points_cache, points_may_lack
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import PRIOR_MAPS

if TYPE_CHECKING:
    from room2dgs.depth.sources.source import Proposal
    from room2dgs.prepare.metres import DepthOf

UNIT = "unit"  # in metrics.json
# An estimate that is less certain would make lengths worse as often as better.
MOST_SIGMA = 0.45
# Most captures that do not tell their unit are in metres or in any other: so many deviations off, either is as likely.
METRES_WITHIN = 1.65
USUAL_DEPTH_M, SAMPLED_VIEWS = 2.0, 12


def estimated_unit(scene: Scene, config: Config, run: RunFolder, *, with_priors: bool) -> EstimatedUnit | None:
    """Finds the unit of a capture that does not tell it; the log and metrics.json say what was found.

    Sparse points are kept in metres, too, so that the next step finds them.

    Args:
        scene: with the poses to work with, in the capture's unit.
        with_priors: whether the run reads priors.

    Returns:
        What to scale the scene by; None: nothing is to be scaled.

    Raises:
        InputError: a map of the prior cannot be used.
    """
    given = config.scene.given_unit
    if given is not None or scene.metric:
        source = "capture" if given is None else "scene.unit"
        run.record({UNIT: {"metres": given or 1.0, "source": source}})
        return None
    found = _estimate(scene, config, run) if with_priors and _can_tell(scene, config) else None
    if found is None or found.sigma > MOST_SIGMA:
        why = "no depth prior in metres is read" if not with_priors or not gives_metres(config) else "no prior tells it"
        if found is not None:
            why = f"{found.sentence()}, is too uncertain"
        run.record({UNIT: {"metres": 1.0, "source": "assumed"}})
        if not _has_depth(scene):
            run.log(f"WARNING: lengths are taken as metres, though the unit of the poses is unknown ({why}); {MEND}")
        return None
    estimate = {"sigma": found.sigma, "photos": found.photos, "estimate_m": found.metres}
    if abs(np.log(found.metres)) <= METRES_WITHIN * found.sigma:
        run.record({UNIT: {"metres": 1.0, "source": "assumed", **estimate}})
        run.log(f"scale: {found.sentence()}: lengths are taken as metres, which fits; {MEND}")
        return None
    run.record({UNIT: {"metres": found.metres, "source": "depth prior", **estimate}})
    run.log(f"scale: {found.sentence()}; the run works in metres by it; {MEND}")
    return found


def _has_depth(scene: Scene) -> bool:
    return any(frame.depth_path for frame in scene.frames)


def _can_tell(scene: Scene, config: Config) -> bool:
    """Whether there is a prior in metres, and no depth of a sensor, which is compared with the poses by itself."""
    return gives_metres(config) and not _has_depth(scene)


def _estimate(scene: Scene, config: Config, run: RunFolder) -> EstimatedUnit | None:
    """By the sparse points that the keyframes see; points are kept as they are in metres."""
    from room2dgs.prepare.metres import NETWORK_SIGMA, scale_by_maps
    from room2dgs.sfm.sparse import keep_points, sparse_points

    cache = points_cache(config, run.path)
    with run.timed("points"):
        points = sparse_points(scene, config.points, cache, _silent, may_lack=points_may_lack(config))
    rough = _rough_factor(scene, points)
    if rough is None:
        return None
    frames = [replace(frame, camera=scaled_camera(frame.camera, rough)) for frame in scene.keyframes]
    depth_of = _depth_of(_proposal(scene, points, config, run))
    found = scale_by_maps(frames, scaled_points(points, rough), depth_of, "depth prior", NETWORK_SIGMA, run.log)
    if found is None or found.sigma is None:
        return None
    unit = EstimatedUnit(rough * found.metres, found.sigma, found.photos)
    if config.points.source != "file":
        keep_points(in_metres(scene, unit), config.points, cache, scaled_points(points, unit.metres))
    return unit


def _rough_factor(scene: Scene, points: PointCloud) -> float | None:
    """What brings points to the usual depth of a room: how near counts as seen is a matter of metres."""
    depths = []
    for frame in evenly_spaced(scene.keyframes, SAMPLED_VIEWS):
        pixel, z = frame.camera.project(points.xyz)
        depths.append(z[(z > 0) & frame.camera.inside(pixel)])
    seen = np.concatenate(depths)
    return USUAL_DEPTH_M / float(np.median(seen)) if len(seen) else None


def _proposal(scene: Scene, points: PointCloud, config: Config, run: RunFolder) -> Proposal:
    """The prior's maps as they are, of which the log tells when they are aligned."""
    from room2dgs.depth.propose import propose
    from room2dgs.depth.state import DepthSettings, first_state

    prior = replace(config.prior, cache=config.prior.cache or str(run.path / PRIOR_MAPS))
    return propose(first_state(scene.keyframes, points), DepthSettings(prior, log=_silent)).proposed


def _depth_of(proposal: Proposal) -> DepthOf:
    def depth_of(frame: Frame) -> tuple[np.ndarray, np.ndarray] | None:
        raw = proposal.raw.get(frame.name)
        return None if raw is None else (raw.values, raw.valid)

    return depth_of


def _silent(line: str) -> None:
    """Takes a line that a later step says."""
