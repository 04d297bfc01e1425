"""Whether the poses are in metres: a depth prior that contradicts them names the scene.unit that would fit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.geometry.camera import NEAR_M
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.metrics import read_metrics

if TYPE_CHECKING:
    from room2dgs.depth import Priors

SCALE = "prior_scale"  # in metrics.json
LEAST_VIEWS, SAMPLED_VIEWS, LEAST_POINTS = 3, 12, 100
# Factors between the prior's metres and the poses' from which on a warning is given: networks are off by tens of
# percent, and who says that poses are metres mostly knows.
UNKNOWN_UNIT, KNOWN_UNIT = 2.0, 3.0


def check_unit(priors: Priors, points: PointCloud, scene: Scene, config: Config, run: RunFolder) -> None:
    """Records the median scale of a prior in metres, and warns if it contradicts the poses.

    Raises:
        InputError: it contradicts them, and its metres were taken although there are points: so near to the cameras
            that none counts as seen.
    """
    if config.prior.depth.meaning != "metric_depth" or not config.prior.depth.align:
        return
    scales = [fit.scale for fit in priors.fits.values() if np.isfinite(fit.residual) and fit.scale > 0]
    fitted = len(scales) >= LEAST_VIEWS
    scale = float(np.median(scales)) if fitted else _scale_at_points(priors, points, scene)
    run.record({SCALE: scale})
    doubt = unit_doubt(scale, scene, _unit(scene, config))
    if doubt and not fitted:
        raise InputError(f"{scene.path} is not in metres: {doubt}")
    if doubt:
        run.log(f"WARNING: {doubt}")


def _scale_at_points(priors: Priors, points: PointCloud, scene: Scene) -> float | None:
    """Median of what points are away, over the prior's depth there, if they are too near to count as seen.

    None: too few tell, or they are farther; then something else is wrong with them.
    """
    ratios, away = [], []
    for frame in scene.keyframes[:: max(1, len(scene.keyframes) // SAMPLED_VIEWS)]:
        maps = priors.by_frame.get(frame.name)
        if maps is None or maps.depth is None or not len(points):
            continue
        pixel, z = frame.camera.project(points.xyz)
        shown = frame.camera.inside(pixel) & (z > 0)
        column, row = np.floor(pixel[shown]).astype(np.int64).T
        depth = np.asarray(maps.depth)[row, column]
        ratios.append(z[shown][depth > 0] / depth[depth > 0])
        away.append(z[shown])
    ratio = np.concatenate(ratios) if ratios else np.zeros(0)
    if len(ratio) < LEAST_POINTS or np.median(np.concatenate(away)) > 2 * NEAR_M:
        return None
    return float(np.median(ratio))


def unit_doubt(scale: float | None, scene: Scene, unit: float | None) -> str | None:
    """What is wrong with the unit of the poses, and what mends it; None: nothing that is known.

    Args:
        scale: times which the prior's metres are the poses'; None: unknown.
        unit: `scene.unit`, or what it was estimated to be; None: lengths are as in the capture.
    """
    known = scene.metric or unit is not None
    if scale is None or max(scale, 1 / scale) < (KNOWN_UNIT if known else UNKNOWN_UNIT):
        return None
    better = float(f"{(unit or 1.0) / scale:.2g}")
    if unit is not None:
        return (
            f"the depth prior finds the room {1 / scale:.2g} times as large as scene.unit={unit:g} makes it: "
            f"give scene.unit={better:g}"
        )
    if scene.metric:
        return (
            f"the depth prior finds the room {1 / scale:.2g} times as large as the poses say, which ought to be in "
            f"metres; if they are not, give scene.unit={better:g}"
        )
    return f"the depth prior finds that one unit of the poses is about {better:g} m: give scene.unit={better:g}"


def _unit(scene: Scene, config: Config) -> float | None:
    """Metres of one unit of the capture's poses, where lengths are not as in the capture."""
    return config.scene.given_unit or scene.unit_m


@contextmanager
def unit_in_no_surface(scene: Scene, config: Config, out: Path) -> Iterator[None]:
    """If the block finds no surface, and the unit of the poses may be the cause, the error says so.

    Raises:
        NoSurface: with the unit in its sentence.
    """
    from room2dgs.mesh.finish import NoSurface

    try:
        yield
    except NoSurface as error:
        scale, unit = read_metrics(out).get(SCALE), _unit(scene, config)
        doubt = unit_doubt(scale if isinstance(scale, float) and scale > 0 else None, scene, unit)
        if doubt and (scene.metric or unit is not None):  # then something else may be the cause
            raise NoSurface(f"{error}; or lengths are in another unit than metres: {doubt}") from error
        if doubt:
            raise NoSurface(f"no surface came out, because lengths are in another unit than metres: {doubt}") from error
        if scene.metric or unit is not None:
            raise
        reach_m = float(np.linalg.norm(np.ptp([frame.camera.centre for frame in scene.frames], axis=0)))
        raise NoSurface(
            f"{error}; or, as {scene.path} does not say its unit and its cameras are {reach_m:.3g} of it apart, give "
            "scene.unit, the metres of one unit"
        ) from error
