"""What is known of the surfaces before anything is trained: sparse points and the depth of each view."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.points import find_points, points_may_lack
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import use_threads
from room2dgs.pipeline.units import check_unit
from room2dgs.runs.folder import KEPT, PRIOR_MAPS, PRIORS, TRUST
from room2dgs.runs.metrics import StageTimes, by_stage, timed

if TYPE_CHECKING:  # torch takes seconds to import, and a wrong path should be reported at once
    from room2dgs.depth import Priors, StereoViews


def points_and_priors(scene: Scene, config: Config, run: RunFolder) -> tuple[PointCloud, Priors]:
    """Sparse points and priors; what they are of goes to metrics.json.

    Raises:
        InputError: as `sparse_points` and `estimate_depth`.
    """
    from room2dgs.runs.kept_priors import keep_priors, key_of

    use_threads(config)
    some = f", {len(scene.keyframes)} of them keyframes" if scene.beside else ""
    run.log(f"{len(scene.train)} training views{some}, {len(scene.test)} held out")
    points = find_points(scene, config, run, may_lack=points_may_lack(config))
    key = key_of(scene, points, config)
    priors = _kept(scene, key, run.path)
    if priors is None:
        with run.timed("priors"):
            priors = find_priors(scene, points, config, run)
            keep_priors(run.path / KEPT, key, priors, run.log)
    else:  # which took its time then
        run.log("priors are there from before")
        check_unit(priors, points, scene, config, run)
    run.record(
        {
            "points": len(points),
            "priors": priors.label,
            "depth_source": priors.depth_source,
            "prior_networks": priors.networks,
        }
    )
    return points, priors


def find_priors(scene: Scene, points: PointCloud, config: Config, run: RunFolder) -> Priors:
    """Priors of the keyframes; how each depth map was aligned goes to priors.csv, how far it is trusted to trust.npz.

    Raises:
        InputError: as `estimate_depth`.
    """
    from room2dgs.depth import estimate_depth
    from room2dgs.runs.trust import write_trust

    times = StageTimes()
    priors = estimate_depth(scene, points, config, run.path / PRIOR_MAPS, run.log, partial(timed, times))
    covered = [float((depth > 0).mean()) for depth, _ in priors.stereo.values()]
    share = round(sum(covered) / len(covered), 4) if covered else None
    run.record({"prior_seconds": by_stage(times), "stereo_coverage": share})
    write_trust(run.path / TRUST, scene.keyframes, priors.by_frame, priors.stereo, priors.planes)
    check_unit(priors, points, scene, config, run)
    if priors.fits:
        _write_fits(run.path / PRIORS, priors)
    return priors


def fill_depth(scene: Scene, points: PointCloud, stereo: StereoViews, config: Config, run: RunFolder) -> Priors:
    """The prior's depth as a run has it, drawn to the stereo that is there already.

    Raises:
        InputError: as `estimate_depth`.
    """
    from room2dgs.depth import estimate_depth

    priors = estimate_depth(scene, points, config, run.path / PRIOR_MAPS, run.log, run.timed, stereo)
    check_unit(priors, points, scene, config, run)
    return priors


def _kept(scene: Scene, key: str, out: Path) -> Priors | None:
    """What `find_priors` gave before the run was killed, if all the files are there that it writes."""
    from room2dgs.runs.kept_priors import kept_priors

    priors = kept_priors(out / KEPT, key, scene)
    if priors is None or (priors.fits and not (out / PRIORS).exists()):
        return None
    has_depth = any(maps.depth is not None for maps in priors.by_frame.values())
    return priors if (out / TRUST).exists() or not has_depth else None


def _write_fits(path: Path, priors: Priors) -> None:
    """A row for each aligned view."""
    from room2dgs.files import whole_file
    from room2dgs.report.csv_text import csv_lines

    rows: list[tuple[object, ...]] = [("view", "scale", "shift", "median_relative_residual", "points")]
    for name, fit in priors.fits.items():
        rows.append((name, f"{fit.scale:.6g}", f"{fit.shift:.6g}", f"{fit.residual:.4f}", fit.points))
    with whole_file(path) as temporary:
        temporary.write_text(csv_lines(rows), encoding="utf-8")
