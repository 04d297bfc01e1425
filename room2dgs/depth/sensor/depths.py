"""Depth from the capture's own depth files: checked, with a standard deviation of each pixel; never fitted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.scene import Frame
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.sensor.maps import sensor_depth, sensor_map, unit_m
from room2dgs.depth.sensor.registration import MIN_VIEW_POINTS, Scale, check_scale, found_shift, scale_warning
from room2dgs.depth.sensor.views import SensorViews
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.texts import some_of

ENOUGH = 0.5  # of the photos; with fewer `auto` takes the network for all
NETWORK = "prior/depth=room_prior uses the network alone"
POINTS_OFF = 0.05  # a median residual at the points that points alone explain


class SensorDepths(NamedTuple):
    """Depth of the photos that have some, in metres, read when asked for.

    Attributes:
        depths: frame name -> (H, W) float32, 0 = invalid.
        sigmas: frame name -> (H, W) float32 relative standard deviation; infinite where there is no depth.
        fits: frame name -> scale 1, shift 0, and how far the map is off its points.
    """

    depths: LazyMaps[np.ndarray]
    sigmas: LazyMaps[np.ndarray]
    fits: dict[str, Fit]


def sensor_depths(frames: Sequence[Frame], views: SensorViews, settings: DepthPriorConfig, log: Log) -> SensorDepths:
    """The depth of a depth camera; what it is good for is logged.

    Args:
        frames: training views.
        views: what their depth files are good for.

    Raises:
        InputError: no depth that can be used, or depth that is clearly in another unit than the poses.
    """
    known = list(views.at_points.values())
    if not known:
        raise InputError(
            "no photo of the capture has a depth file that can be used; give prior/depth=room_prior, or none, instead "
            "of prior/depth=sensor"
        )
    first = next(frame for frame in frames if frame.name in views.at_points)
    unit = unit_m(first, settings)
    scale = check_scale(known, unit)
    if not views.frames:
        raise InputError(
            f"no depth file of the capture has a depth between prior.depth.sensor.min_m={settings.sensor.min_m:g} and "
            f"max_m={settings.sensor.max_m:g}; widen them, or give prior/depth=room_prior"
        )
    _log_fit(views, len(frames), scale, log)
    warning = scale_warning(scale, unit) if scale else None
    if warning:
        log(warning)
    _warn_of_shift(views, first.camera.width, log)
    _warn_of_strangers(views, log)
    return _maps(views, settings)


def _maps(views: SensorViews, settings: DepthPriorConfig) -> SensorDepths:
    found = SensorDepths(LazyMaps(), LazyMaps(), {})
    for frame in views.frames:
        at = views.at_points[frame.name]
        found.fits[frame.name] = Fit(1.0, 0.0, at.residual, len(at.ratio))
        found.depths.add(frame.name, partial(sensor_depth, frame, settings))
        found.sigmas.add(frame.name, partial(_sigma, frame, settings, _excess(found.fits[frame.name])))
    return found


def _sigma(frame: Frame, settings: DepthPriorConfig, excess: float) -> np.ndarray:
    """(H, W) of the depth camera's own noise, and of what the view's points say beyond that."""
    depth, error = sensor_map(frame, settings)
    relative = np.divide(error, depth, out=np.full_like(error, np.inf), where=depth > 0)
    return np.hypot(relative, np.float32(excess))


def _excess(fit: Fit) -> float:
    """What a view's own points say that its map is off beyond what points are: a file of another photo, for example."""
    if fit.points < MIN_VIEW_POINTS:
        return 0.0
    return max(0.0, fit.residual - POINTS_OFF)


def _log_fit(views: SensorViews, count: int, scale: Scale | None, log: Log) -> None:
    residuals = [at.residual for at in views.at_points.values() if len(at.ratio)]
    if scale is None:
        fit = "too few sparse points to check scale and registration"
    else:
        off = f"off the sparse points by {np.median(residuals):.1%} (median view)"
        fit = f"{off}, scale {scale.value:.3f} ± {scale.error:.1%}"
    log(f"depth: sensor ({len(views.frames)} of {count} photos); {fit}; {NETWORK}")


def _warn_of_shift(views: SensorViews, width: int, log: Log) -> None:
    shift = found_shift(list(views.at_points.values()), width)
    if shift is not None:
        log(
            f"WARNING: depth maps lie beside their photos: moved by ({shift[0]:+d}, {shift[1]:+d}) pixels of {width} "
            f"(right, down) they fit the sparse points better; register depth to colour; {NETWORK}"
        )


def _warn_of_strangers(views: SensorViews, log: Log) -> None:
    """Views whose depth does not fit them."""
    names = [
        name
        for name, at in views.at_points.items()
        if len(at.ratio) >= MIN_VIEW_POINTS and at.residual > 2 * POINTS_OFF
    ]
    if names:
        log(f"WARNING: depth far off the sparse points of its own photo, it weighs less: {some_of(names)}")
