"""Depth maps of the views, each aligned to the sparse points, then all of them bent until they agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from room2dgs.captures.scene import Frame, PointCloud
from room2dgs.config import DepthPriorConfig
from room2dgs.geometry.depth_maps import pixel_rays, project, unhidden
from room2dgs.priors.align.point_trust import contradicted
from room2dgs.priors.align.scale_shift import MIN_POINTS, Fit, aligned_depth, fit_scale_shift, residual
from room2dgs.priors.confidence import read_confidence
from room2dgs.priors.files import read_depth
from room2dgs.priors.joint.optimise import joint_depths
from room2dgs.sfm.pairs import shared_view

Log = Callable[[str], None]
MAX_DEPTH_M = 100.0
# Maps in metres are off by a factor rather than by a shift: a free shift would follow their smooth errors.
METRIC_SHIFT_M = 0.1
# With fewer points of its own a view is aligned to the views beside it too: so few can fit by chance.
FEW_POINTS = 30
NEIGHBOURS, LEAST_SHARED = 6, 0.05
STRIDE = 16  # pixels between the points that a view lends


def aligned_depths(
    frames: Sequence[Frame], files: Mapping[str, Path], points: PointCloud, settings: DepthPriorConfig, log: Log
) -> tuple[dict[str, np.ndarray], dict[str, Fit]]:
    """Read every map and bring it to metres.

    Args:
        frames: training views.
        files: frame name -> map; frames may have none.

    Returns:
        Frame name -> (H, W) float32 metres, 0 = invalid, for the maps that fit; frame name -> fit for those that
        could be aligned at all.

    Raises:
        InputError: an unusable map.
    """
    frames = [frame for frame in frames if frame.name in files]
    raw = {frame.name: _read(files[frame.name], settings, frame) for frame in frames}
    depths, fits = _to_points(frames, raw, points, settings, log)
    if settings.align:
        _to_neighbours(frames, raw, points, settings, depths, fits, log)
    for frame in frames:
        if frame.name not in fits:
            log(f"depth prior of {frame.name} left out: it has too few points, and no view beside it has a map")
    kept = [fits[name] for name in depths if np.isfinite(fits[name].residual)]
    if not depths:
        log(f"depth prior: none of {len(frames)} maps fits the sparse points; training goes on without depth")
    elif kept:
        off = [fit.residual for fit in kept]
        log(
            f"depth prior: {len(depths)} of {len(frames)} maps used; off the sparse points by {np.median(off):.1%} "
            f"(median view), {max(off):.1%} (worst); median scale {np.median([fit.scale for fit in kept]):.3g}"
        )
    return depths, fits


def agreeing_depths(
    frames: Sequence[Frame],
    depths: dict[str, np.ndarray],
    normals: dict[str, np.ndarray],
    points: PointCloud,
    settings: DepthPriorConfig,
    log: Log,
    weights: tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]] = ({}, {}),
) -> dict[str, np.ndarray]:
    """The maps bent by `joint_depths`, with a line about how well they agree; none if the points speak against them.

    Views may agree on what is wrong: a network that takes blank walls for nearer than they are does so from everywhere.
    It shows at the sparse points, which no smooth bending can then satisfy.

    Args:
        weights: of the depths' and of the normals' pixels, as `joint_depths` has them.
    """
    bent = joint_depths(frames, depths, normals, points, settings.manhattan, *weights)
    (views_before, views_after), (points_before, points_after) = bent.between_views, bent.at_points
    found = []
    if not np.isnan(views_after):
        found.append(f"they differ by {views_after:.1%} ({views_before:.1%} before)")
    if not np.isnan(points_after):
        found.append(f"from the sparse points by {points_after:.1%} ({points_before:.1%})")
    log(f"depth prior bent until views agree: {', '.join(found) or 'no two of them overlap'}")
    if bent.misfit > settings.max_outlier_ratio:
        log(
            f"WARNING: depth prior left out: {bent.misfit:.0%} of the sparse points are more than 5% off all the same; "
            "a better network would help, or prior.depth.max_outlier_ratio=1 uses it as it is"
        )
        return {}
    return _uncontradicted(frames, bent.depths, points, log)


def _uncontradicted(
    frames: Sequence[Frame], depths: Mapping[str, np.ndarray], points: PointCloud, log: Log
) -> dict[str, np.ndarray]:
    kept, before, after = {}, 0, 0
    for frame in frames:
        if frame.name in depths:
            depth = depths[frame.name]
            kept[frame.name] = np.where(contradicted(depth, frame.camera, points.xyz), np.float32(0), depth)
            before += np.count_nonzero(depth)
            after += np.count_nonzero(kept[frame.name])
    if after < before:
        log(f"depth prior: {1 - after / before:.0%} of its pixels left out, where sparse points contradict it")
    return kept


Raw = Mapping[str, tuple[np.ndarray, np.ndarray]]


def _read(path: Path, settings: DepthPriorConfig, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    values, valid = read_depth(path, settings, frame.camera)
    confidence = read_confidence(path, settings.onnx)
    return values, valid if confidence is None else valid & (confidence > 0)


def _to_points(
    frames: Sequence[Frame], raw: Raw, points: PointCloud, settings: DepthPriorConfig, log: Log
) -> tuple[dict[str, np.ndarray], dict[str, Fit]]:
    depths: dict[str, np.ndarray] = {}
    fits: dict[str, Fit] = {}
    for frame in frames:
        x, y = _at_points(*raw[frame.name], frame, points.xyz, settings)
        if not settings.align:
            fit = Fit(1.0, 0.0, residual(x, y, 1.0, 0.0), len(x))
        elif len(x) >= FEW_POINTS:
            fit = fit_scale_shift(x, y, shift_sigma=_shift_sigma(settings))
        else:
            continue
        if fit:
            fits[frame.name] = fit
            _take(frame, raw, fit, settings, depths, log)
    return depths, fits


def _to_neighbours(
    frames: Sequence[Frame],
    raw: Raw,
    points: PointCloud,
    settings: DepthPriorConfig,
    depths: dict[str, np.ndarray],
    fits: dict[str, Fit],
    log: Log,
) -> None:
    """Align the views that have few points to what the aligned views beside them show; adds to depths and fits."""
    waiting = [index for index, frame in enumerate(frames) if frame.name not in fits]
    if not fits and settings.meaning == "metric_depth":
        # One scale from all views' points, or the map's own word: a view that passed its scale on would be worth less.
        seen = [_at_points(*raw[frame.name], frame, points.xyz, settings) for frame in frames]
        pooled = [np.concatenate(part) for part in zip(*seen, strict=True)] or [np.zeros(0), np.zeros(0)]
        common = fit_scale_shift(*pooled, shift_sigma=METRIC_SHIFT_M) or Fit(1.0, 0.0, float("nan"), 0)
        for frame, (x, y) in zip(frames, seen, strict=True):
            fit = fit_scale_shift(x, y, shift_sigma=METRIC_SHIFT_M) or common
            fits[frame.name] = fit._replace(points=len(x))
            _take(frame, raw, fits[frame.name], settings, depths, log)
        if frames:
            scale = f"a scale of {common.scale:.3g}"
            log(f"depth prior: no view has {FEW_POINTS} sparse points; its metres are taken with {scale}")
        return
    shared = shared_view([frame.camera for frame in frames]) if frames else np.zeros((0, 0))
    while waiting:
        known = np.array([frame.name in depths for frame in frames])
        # who sees most of what is known goes first, and is known to the next
        index = max(waiting, key=lambda i: (np.sort(shared[i] * known)[-NEIGHBOURS:].sum(), -i))
        waiting.remove(index)
        frame = frames[index]
        beside = [j for j in np.argsort(-shared[index] * known, kind="stable")[:NEIGHBOURS] if known[j]]
        beside = [j for j in beside if shared[index, j] > LEAST_SHARED]
        x, y = _at_points(*raw[frame.name], frame, points.xyz, settings)
        own = len(x)
        for j in beside:
            lent = _at_points(*raw[frame.name], frame, _lent(frames[j], depths[frames[j].name]), settings)
            x, y = np.concatenate([x, lent[0]]), np.concatenate([y, lent[1]])
        fit = fit_scale_shift(x, y, shift_sigma=_shift_sigma(settings)) or _common(fits, own, settings)
        if fit:
            fits[frame.name] = fit._replace(points=own)
            if _take(frame, raw, fit, settings, depths, log):
                log(f"depth prior of {frame.name} aligned to {len(beside)} views beside it: it has {own} points")


def _take(
    frame: Frame, raw: Raw, fit: Fit, settings: DepthPriorConfig, depths: dict[str, np.ndarray], log: Log
) -> bool:
    if fit.residual > settings.max_residual:
        log(f"depth prior of {frame.name} left out: {fit.residual:.1%} off its {fit.points} points")
        return False
    depths[frame.name] = aligned_depth(*raw[frame.name], fit, _is_disparity(settings), MAX_DEPTH_M)
    return True


def _at_points(
    values: np.ndarray, valid: np.ndarray, frame: Frame, xyz: np.ndarray, settings: DepthPriorConfig
) -> tuple[np.ndarray, np.ndarray]:
    """The map's values and the points' depths (or disparities) where points fall into the view."""
    pixel, z = project(xyz, frame.camera)
    seen = unhidden(pixel, z, cell_px=max(4, frame.camera.width // 24))
    pixel, z = pixel[seen], z[seen]
    known = valid[pixel[:, 1], pixel[:, 0]]
    x = values[pixel[known, 1], pixel[known, 0]].astype(np.float64)
    return x, 1.0 / z[known] if _is_disparity(settings) else z[known]


def _lent(frame: Frame, depth: np.ndarray) -> np.ndarray:
    """(M, 3) world points of a coarse grid of an aligned map's pixels."""
    grid = (slice(STRIDE // 2, None, STRIDE),) * 2
    in_cam = (pixel_rays(frame.camera)[grid] * depth[grid][..., None])[depth[grid] > 0]
    return (in_cam - frame.camera.cam_from_world[:3, 3]) @ frame.camera.cam_from_world[:3, :3]


def _common(fits: Mapping[str, Fit], own: int, settings: DepthPriorConfig) -> Fit | None:
    """The other views' median scale and shift; relative maps have no common one."""
    good = [fit for fit in fits.values() if fit.residual <= settings.max_residual]
    if settings.meaning != "metric_depth" or not good or own >= MIN_POINTS:
        return None
    scale, shift = (float(np.median([getattr(fit, name) for fit in good])) for name in ("scale", "shift"))
    return Fit(scale, shift, float("nan"), own)


def _is_disparity(settings: DepthPriorConfig) -> bool:
    return settings.meaning == "relative_inverse_depth"


def _shift_sigma(settings: DepthPriorConfig) -> float | None:
    return METRIC_SHIFT_M if settings.meaning == "metric_depth" else None
