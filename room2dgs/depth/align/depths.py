"""Depth maps of all views, each aligned to the sparse points, or to its neighbours where it has few points."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from room2dgs import _C
from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import likely_points
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.align.neighbours import FEW_POINTS, align_to_neighbours
from room2dgs.depth.align.one_view import RawMaps, add_aligned, pairs_at_points, shift_sigma
from room2dgs.depth.align.scale_shift import Fit, fit_scale_shift, residual
from room2dgs.depth.align.usual_scale import UsualScale, usual_scale
from room2dgs.logs import Log
from room2dgs.parallel_map import parallel_map


def aligned_depths(
    frames: Sequence[Frame], raw: RawMaps, points: PointCloud, settings: DepthPriorConfig, log: Log
) -> tuple[LazyMaps[np.ndarray], dict[str, Fit]]:
    """Bring every map to metres.

    Args:
        frames: training views.
        raw: frame name -> map; frames may have none.
        points: sparse points and depth samples, metres.

    Returns:
        Frame name -> (H, W) float32 metres, 0 = invalid, read when asked for; frame name -> fit; of the maps that
        could be aligned.

    Raises:
        InputError: an unusable map.
    """
    frames = [frame for frame in frames if frame.name in raw]
    depths, fits = _align_to_points(frames, raw, points, settings, log)
    if settings.align:
        align_to_neighbours(frames, raw, points, settings, depths, fits, log)
    for frame in frames:
        if frame.name not in fits:
            log(f"depth prior of {frame.name} left out: it has too few points, and no view beside it has a map")
    with_points = [fits[name] for name in depths if np.isfinite(fits[name].residual)]
    if not depths:
        log(f"depth prior: none of {len(frames)} maps could be aligned; training goes on without depth")
    elif with_points:
        off = [fit.residual for fit in with_points]
        log(
            f"depth prior: {len(depths)} of {len(frames)} maps used; off the sparse points by {np.median(off):.1%} "
            f"(median view), {max(off):.1%} (worst); median scale {np.median([fit.scale for fit in with_points]):.3g}"
        )
    return depths, fits


def _align_to_points(
    frames: Sequence[Frame], raw: RawMaps, points: PointCloud, settings: DepthPriorConfig, log: Log
) -> tuple[LazyMaps[np.ndarray], dict[str, Fit]]:
    depths: LazyMaps[np.ndarray] = LazyMaps()
    fits: dict[str, Fit] = {}

    def fitted(frame: Frame, usual: UsualScale | None = None) -> Fit | None:
        x, y = pairs_at_points(raw[frame.name], likely_points(points, frame)[0], settings)
        if not settings.align:
            return Fit(1.0, 0.0, residual(x, y, 1.0, 0.0), len(x))
        return fit_scale_shift(x, y, shift_sigma=shift_sigma(settings), usual=usual) if len(x) >= FEW_POINTS else None

    found = list(parallel_map(fitted, frames, _C.threads()))
    usual = usual_scale([fit.scale for fit in found if fit])
    if settings.align and settings.meaning == "metric_depth" and usual:
        found = list(parallel_map(partial(fitted, usual=usual), frames, _C.threads()))
    for frame, fit in zip(frames, found, strict=True):
        if fit:
            fits[frame.name] = fit
            add_aligned(frame, raw, fit, settings, depths)
    return depths, fits
