"""The sparse points of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import POINTS

if TYPE_CHECKING:  # pycolmap takes long to import, and a wrong path should be reported at once
    from room2dgs.sfm.sparse import MayLack


def find_points(scene: Scene, config: Config, run: RunFolder, **options: Any) -> PointCloud:
    """The sparse points; those that are triangulated lie in the run's folder unless points.cache says where.

    Args:
        options: `may_lack` and `instead` of `sparse_points`.

    Raises:
        InputError: as `sparse_points`.
    """
    from room2dgs.sfm.sparse import sparse_points

    with run.timed("points"):
        return sparse_points(scene, config.points, points_cache(config, run.path), run.log, **options)


def find_points_alone(scene: Scene, config: Config, run: RunFolder, depth_source: str) -> PointCloud:
    """The sparse points of a run that reads no priors; metrics.json says so.

    Args:
        depth_source: for metrics.json.

    Raises:
        InputError: as `sparse_points`.
    """
    run.log(
        f"{len(scene.train)} training views, {len(scene.test)} held out; no priors (mesh.source={config.mesh.source})"
    )
    points = find_points(scene, config, run, instead="mesh.source=depth prior=room_prior")
    run.record(
        {
            "points": len(points),
            "priors": "none",
            "depth_source": depth_source,
            "prior_networks": {},
            "stereo_coverage": None,
        }
    )
    return points


def points_cache(config: Config, out: Path) -> Path:
    """Where triangulated points lie."""
    return Path(config.points.cache or out / POINTS)


def gives_metres(config: Config) -> bool:
    """Whether a prior gives depth in metres, so that a run can do without sparse points."""
    return config.prior.depth.source != "none" and config.prior.depth.meaning == "metric_depth"


def points_may_lack(config: Config) -> MayLack:
    """Whether a run goes on without sparse points."""
    from room2dgs.sfm.sparse import MayLack

    return MayLack.WITH_METRES if gives_metres(config) else MayLack.NEVER
