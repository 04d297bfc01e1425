"""Alignment of the views that have few sparse points of their own to the aligned views beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import likely_points, probably_seen
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.align.one_view import METRIC_SHIFT_M, RawMaps, add_aligned, pairs_at_points, shift_sigma
from room2dgs.depth.align.scale_shift import MIN_POINTS, Fit, fit_scale_shift
from room2dgs.geometry.view_selection import shared_view
from room2dgs.logs import Log

# With fewer points of its own a view is aligned to its neighbours too: so few can fit by chance.
FEW_POINTS = 30
NEIGHBOURS, MIN_SHARED = 6, 0.05
STRIDE = 16  # pixels between the points that are sampled from a neighbour's map


def align_to_neighbours(
    frames: Sequence[Frame],
    raw: RawMaps,
    points: PointCloud,
    settings: DepthPriorConfig,
    depths: LazyMaps[np.ndarray],
    fits: dict[str, Fit],
    log: Log,
) -> None:
    """Align the views that have few points to what the aligned views beside them show; adds to depths and fits."""
    waiting = [index for index, frame in enumerate(frames) if frame.name not in fits]
    if not fits and settings.meaning == "metric_depth":
        _align_by_one_scale(frames, raw, points, settings, depths, fits, log)
        return
    shared = shared_view([frame.camera for frame in frames]) if frames else np.zeros((0, 0))
    while waiting:
        known = np.array([frame.name in depths for frame in frames])
        # who sees most of what is known goes first, and is known to the next
        index = max(waiting, key=lambda i: (np.sort(shared[i] * known)[-NEIGHBOURS:].sum(), -i))
        waiting.remove(index)
        frame = frames[index]
        beside = [j for j in np.argsort(-shared[index] * known, kind="stable")[:NEIGHBOURS] if known[j]]
        beside = [j for j in beside if shared[index, j] > MIN_SHARED]
        read = raw[frame.name]
        x, y = pairs_at_points(read, likely_points(points, frame)[0], settings)
        own = len(x)
        for j in beside:
            sampled = _sampled_points(frames[j], depths[frames[j].name])
            found = pairs_at_points(read, probably_seen(sampled, frame.camera), settings)
            x, y = np.concatenate([x, found[0]]), np.concatenate([y, found[1]])
        fit = fit_scale_shift(x, y, shift_sigma=shift_sigma(settings)) or _common_fit(fits, own, settings)
        if fit:
            fits[frame.name] = fit._replace(points=own)
            add_aligned(frame, raw, fit, settings, depths)
            log(f"depth prior of {frame.name} aligned to {len(beside)} views beside it: it has {own} points")


def _align_by_one_scale(
    frames: Sequence[Frame],
    raw: RawMaps,
    points: PointCloud,
    settings: DepthPriorConfig,
    depths: LazyMaps[np.ndarray],
    fits: dict[str, Fit],
    log: Log,
) -> None:
    """Metric maps of views that all have few points: one fit to the points of all views, else the maps as they are.

    Passing on the scale of one view would be worse.
    """
    seen = [pairs_at_points(raw[frame.name], likely_points(points, frame)[0], settings) for frame in frames]
    x_all, y_all = (np.concatenate([np.zeros(0), *(pair[axis] for pair in seen)]) for axis in (0, 1))
    common = fit_scale_shift(x_all, y_all, shift_sigma=METRIC_SHIFT_M) or Fit(1.0, 0.0, float("nan"), 0)
    for frame, (x, y) in zip(frames, seen, strict=True):
        fit = fit_scale_shift(x, y, shift_sigma=METRIC_SHIFT_M) or common
        fits[frame.name] = fit._replace(points=len(x))
        add_aligned(frame, raw, fits[frame.name], settings, depths)
    if frames:
        scale = f"a scale of {common.scale:.3g}"
        log(f"depth prior: no view has {FEW_POINTS} sparse points; its metres are taken with {scale}")


def _sampled_points(frame: Frame, depth: np.ndarray) -> np.ndarray:
    """(M, 3) world points of a coarse grid of an aligned map's pixels."""
    grid = (slice(STRIDE // 2, None, STRIDE),) * 2
    return frame.camera.unproject_map(depth)[grid][depth[grid] > 0]


def _common_fit(fits: Mapping[str, Fit], own: int, settings: DepthPriorConfig) -> Fit | None:
    """The other views' median scale and shift; relative maps have no common one."""
    good = [fit for fit in fits.values() if np.isfinite(fit.residual)]
    if settings.meaning != "metric_depth" or not good or own >= MIN_POINTS:
        return None
    scale, shift = (float(np.median([getattr(fit, name) for fit in good])) for name in ("scale", "shift"))
    return Fit(scale, shift, float("nan"), own)
