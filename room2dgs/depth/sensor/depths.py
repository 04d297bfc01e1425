"""Depth priors from the capture's own depth files: chosen, checked, and weighed pixel by pixel; never fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.confidence import confidence_of
from room2dgs.depth.sensor.maps import sensor_depth, sensor_map, unit_m
from room2dgs.depth.sensor.registration import MIN_VIEW_POINTS, check_scale, found_shift
from room2dgs.depth.sensor.views import NO_FILE, SensorViews, sensor_views
from room2dgs.errors import InputError
from room2dgs.logs import Log

ENOUGH = 0.5  # of the photos; with fewer `auto` takes the network for all
NETWORK = "prior/depth=room_prior uses the network alone"
POINTS_OFF = 0.05  # a median residual at the points that points alone explain


class SensorDepths(NamedTuple):
    """Depth of the photos that have some, in metres, read when asked for.

    Attributes:
        depths: frame name -> (H, W) float32, 0 = invalid.
        confidences: frame name -> (H, W) float32 in 0..1.
        fits: frame name -> scale 1, shift 0, and how far the map is off its points.
    """

    depths: LazyMaps[np.ndarray]
    confidences: LazyMaps[np.ndarray]
    fits: dict[str, Fit]


def sensor_depths(
    frames: Sequence[Frame], points: PointCloud, settings: DepthPriorConfig, log: Log
) -> tuple[DepthPriorConfig, SensorDepths | None]:
    """The depth of a depth camera, if the settings ask for it and the capture has it.

    Args:
        frames: training views.
        points: the scene's sparse points, metres.
        settings: with source "sensor" or "auto", other sources stay as they are.

    Returns:
        The settings with "auto" decided, and the maps; None with another source than "sensor".

    Raises:
        InputError: source "sensor" and no depth that can be used, or depth in another scale than the poses.
    """
    if settings.source not in ("sensor", "auto"):
        return settings, None
    as_network = replace(settings, source="room_prior") if settings.source == "auto" else None
    if as_network and not any(frame.depth_path for frame in frames):
        return as_network, None
    views = sensor_views(frames, points, settings)
    _tell_unusable(views, len(frames), log)
    if as_network and len(views.at_points) < ENOUGH * len(frames):
        log(
            f"depth: room_prior ({len(views.at_points)} of {len(frames)} photos have depth of their own, which is too "
            "few; prior/depth=sensor uses it)"
        )
        return as_network, None
    known = list(views.at_points.values())
    if not known:
        raise InputError(
            "no photo of the capture has a depth file that can be used; give prior/depth=room_prior, or none, instead "
            "of prior/depth=sensor"
        )
    first = next(frame for frame in frames if frame.name in views.at_points)
    scale = check_scale(known, unit_m(first, settings))
    if not views.frames:
        raise InputError(
            f"no depth file of the capture has a depth between prior.depth.sensor.min_m={settings.sensor.min_m:g} and "
            f"max_m={settings.sensor.max_m:g}; widen them, or give prior/depth=room_prior"
        )
    _tell(views, len(frames), scale, log)
    _warn_of_shift(views, first.camera.width, log)
    _warn_of_strangers(views, log)
    return replace(settings, source="sensor", align=False, joint=False), _maps(views, settings)


def _maps(views: SensorViews, settings: DepthPriorConfig) -> SensorDepths:
    found = SensorDepths(LazyMaps(), LazyMaps(), {})
    for frame in views.frames:
        at = views.at_points[frame.name]
        found.fits[frame.name] = Fit(1.0, 0.0, at.residual, len(at.ratio))
        found.depths.add(frame.name, partial(sensor_depth, frame, settings))
        found.confidences.add(frame.name, partial(_confidence, frame, settings, _excess(found.fits[frame.name])))
    return found


def _confidence(frame: Frame, settings: DepthPriorConfig, excess: float) -> np.ndarray:
    """By the same rule as a network's: of the expected error of ln depth."""
    depth, error = sensor_map(frame, settings)
    relative = np.divide(error, depth, out=np.full_like(error, np.inf), where=depth > 0)
    return confidence_of(np.hypot(relative, np.float32(excess)), settings.onnx)


def _excess(fit: Fit) -> float:
    """What a view's own points say that its map is off beyond what points are: a file of another photo, for example."""
    if fit.points < MIN_VIEW_POINTS:
        return 0.0
    return max(0.0, fit.residual - POINTS_OFF)


def _tell(views: SensorViews, count: int, scale: float | None, log: Log) -> None:
    residuals = [at.residual for at in views.at_points.values() if len(at.ratio)]
    if scale is None:
        fit = "too few sparse points to check scale and registration"
    else:
        fit = f"off the sparse points by {np.median(residuals):.1%} (median view), scale {scale:.3f}"
    log(f"depth: sensor ({len(views.frames)} of {count} photos); {fit}; {NETWORK}")


def _tell_unusable(views: SensorViews, count: int, log: Log) -> None:
    missing = [name for name, why in views.without.items() if why == NO_FILE]
    broken = {name: why for name, why in views.without.items() if why != NO_FILE}
    if missing and len(missing) < count:
        log(f"depth: {len(missing)} of {count} photos have no depth file: {_some(missing)}")
    if broken:
        first = next(iter(broken.values()))
        more = f" (and {len(broken) - 1} more depth files: {_some(list(broken)[1:])})" if len(broken) > 1 else ""
        log(f"depth: the run goes on without {next(iter(broken))}'s, {first}{more}")
    if views.out_of_reach:
        log(f"depth: nothing within the sensor's reach in {_some(views.out_of_reach)}")


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
        log(f"WARNING: depth far off the sparse points of its own photo, it weighs less: {_some(names)}")


def _some(names: list[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
