"""All priors of a scene: read, aligned, checked, and every frame without one named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.config import DepthPriorConfig, NormalPriorConfig, PriorConfig
from room2dgs.errors import InputError
from room2dgs.priors.align import Fit, aligned_depth, fit_scale_shift, residual
from room2dgs.priors.convention import Sample, camera_normals, judge
from room2dgs.priors.files import find_map, read_depth, read_normal
from room2dgs.priors.geometry import depth_normals, pixel_rays, project, unhidden
from room2dgs.priors.prior import Prior
from room2dgs.priors.simulated import simulated
from room2dgs.scene.scene import Frame, PointCloud

Log = Callable[[str], None]
MAX_DEPTH_M = 100.0
# Maps in metres are off by a factor rather than by a shift: a free shift would follow their smooth errors.
METRIC_SHIFT_M = 0.1
CHECKED_FRAMES, CHECKED_STRIDE = 24, 8


class Priors(NamedTuple):
    """What `load_priors` found.

    Attributes:
        by_frame: frame name -> Prior, for the frames that have one.
        fits: frame name -> its depth's alignment, for every frame with a depth map, left out or not.
        label: "simulated" if any map says so, "files", or "none".
    """

    by_frame: dict[str, Prior]
    fits: dict[str, Fit]
    label: str


def load_priors(frames: Sequence[Frame], points: PointCloud, config: PriorConfig, log: Log = print) -> Priors:
    """Read and align the priors of some frames.

    Args:
        frames: training views.
        points: the scene's sparse points, metres.
        config: sources and conventions.
        log: takes one line at a time.

    Raises:
        InputError: no map for any frame, an unusable map, or normals in another convention than configured.
    """
    depths, fits = _depths(frames, points, config.depth, log) if config.depth.source != "none" else ({}, {})
    normals: dict[str, np.ndarray] = {}
    if config.normal.source != "none":
        normals = _normals(frames, depths, config.normal, log)
    folders = [Path(part.path) for part in (config.depth, config.normal) if part.source != "none" and part.path]
    label = "none" if not folders else "simulated" if any(simulated(folder) for folder in folders) else "files"
    if label == "simulated":
        log("simulated priors: made from ground truth, for studies only")
    by_frame = {}
    for frame in frames:
        depth, normal = depths.get(frame.name), normals.get(frame.name)
        if depth is not None or normal is not None:
            by_frame[frame.name] = Prior(
                depth,
                None if depth is None else depth > 0,
                normal,
                None if normal is None else normal.any(axis=-1),
            )
    return Priors(by_frame, fits, label)


def _maps(frames: Sequence[Frame], path: str | None, kind: str, log: Log) -> dict[str, Path]:
    """Frame name -> file; the missing ones are logged."""
    folder = Path(path or "")
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give prior.{kind}.path=DIR with a map for each photo")
    found = {frame.name: file for frame in frames if (file := find_map(folder, frame))}
    if not found:
        raise InputError(
            f"{folder} has no map for any of the {len(frames)} views; name them as the photos, "
            f"for example {frames[0].color_path.stem}.png or .npy"
        )
    missing = [frame.name for frame in frames if frame.name not in found]
    if missing:
        log(f"{kind} prior: no map for {len(missing)} of {len(frames)} views: {_some(missing)}")
    return found


def _depths(
    frames: Sequence[Frame], points: PointCloud, settings: DepthPriorConfig, log: Log
) -> tuple[dict[str, np.ndarray], dict[str, Fit]]:
    """Frame name -> (H, W) float32 aligned metres, 0 = invalid; and every frame's fit."""
    files = _maps(frames, settings.path, "depth", log)
    disparity = settings.meaning == "relative_inverse_depth"
    sigma = METRIC_SHIFT_M if settings.meaning == "metric_depth" else None
    frames = [frame for frame in frames if frame.name in files]
    pairs: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    own: dict[str, Fit] = {}
    raw: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for frame in frames:
        raw[frame.name] = values, valid = read_depth(files[frame.name], settings, frame.camera)
        x, y = pairs[frame.name] = _at_points(values, valid, frame, points, disparity)
        fit = (
            fit_scale_shift(x, y, shift_sigma=sigma)
            if settings.align
            else Fit(1.0, 0.0, residual(x, y, 1.0, 0.0), len(x))
        )
        if fit:
            own[frame.name] = fit
    fits = {frame.name: own.get(frame.name) or _from_others(own, *pairs[frame.name], settings) for frame in frames}
    depths: dict[str, np.ndarray] = {}
    for frame in frames:
        fit = fits[frame.name]
        if fit is None:
            log(f"depth prior of {frame.name} left out: {len(pairs[frame.name][0])} points are too few to align it")
        elif fit.residual > settings.max_residual:
            log(f"depth prior of {frame.name} left out: {fit.residual:.1%} off its {fit.points} points")
        else:
            depths[frame.name] = aligned_depth(*raw.pop(frame.name), fit, disparity, MAX_DEPTH_M)
            if frame.name not in own:
                log(f"depth prior of {frame.name} takes the other views' scale: it has {fit.points} points")
    kept = [fits[name] for name in depths if fits[name].points]
    if not depths:
        log(f"depth prior: none of {len(frames)} maps fits the sparse points; training goes on without depth")
    elif kept:
        off = [fit.residual for fit in kept]
        log(
            f"depth prior: {len(depths)} of {len(frames)} maps used; off the sparse points by {np.median(off):.1%} "
            f"(median view), {max(off):.1%} (worst); median scale {np.median([fit.scale for fit in kept]):.3g}"
        )
    return depths, {name: fit for name, fit in fits.items() if fit}


def _at_points(
    values: np.ndarray, valid: np.ndarray, frame: Frame, points: PointCloud, disparity: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The map's values and the points' depths (or disparities) where points fall into the view."""
    pixel, z = project(points.xyz, frame.camera)
    seen = unhidden(pixel, z, cell_px=max(4, frame.camera.width // 24))
    pixel, z = pixel[seen], z[seen]
    known = valid[pixel[:, 1], pixel[:, 0]]
    x = values[pixel[known, 1], pixel[known, 0]].astype(np.float64)
    return x, 1.0 / z[known] if disparity else z[known]


def _from_others(own: dict[str, Fit], x: np.ndarray, y: np.ndarray, settings: DepthPriorConfig) -> Fit | None:
    """The other views' median scale and shift; relative maps have no common one."""
    if not own or settings.meaning != "metric_depth":
        return None
    good = [fit for fit in own.values() if fit.residual <= settings.max_residual]
    if not good:
        return None
    scale, shift = (float(np.median([getattr(fit, name) for fit in good])) for name in ("scale", "shift"))
    return Fit(scale, shift, residual(x, y, scale, shift), len(x))


def _normals(
    frames: Sequence[Frame], depths: dict[str, np.ndarray], settings: NormalPriorConfig, log: Log
) -> dict[str, np.ndarray]:
    """Frame name -> (H, W, 3) float32 unit world normals facing the camera, 0 = invalid."""
    files = _maps(frames, settings.path, "normal", log)
    frames = [frame for frame in frames if frame.name in files]
    # The check comes first: a wrong convention is told before all maps are read.
    some = frames[:: max(1, len(frames) // CHECKED_FRAMES)]
    _check_convention(
        [_sample(frame, files[frame.name], depths.get(frame.name), settings) for frame in some], settings, log
    )
    normals = {}
    for frame in frames:
        raw, valid = read_normal(files[frame.name], settings, frame.camera)
        in_cam = camera_normals(raw, settings, frame.camera)
        # A surface that is seen faces the camera; where a map says otherwise it is wrong.
        valid &= (in_cam * pixel_rays(frame.camera)).sum(axis=-1) < 0
        in_world = in_cam @ frame.camera.cam_from_world[:3, :3]
        if valid.any():
            normals[frame.name] = np.where(valid[..., None], in_world, 0.0).astype(np.float32)
        else:
            log(f"normal prior of {frame.name} left out: no pixel of it faces the camera")
    log(f"normal prior: {len(normals)} of {len(frames)} maps used")
    return normals


def _sample(frame: Frame, file: Path, depth: np.ndarray | None, settings: NormalPriorConfig) -> Sample:
    raw, valid = read_normal(file, settings, frame.camera)
    grid = (slice(None, None, CHECKED_STRIDE), slice(None, None, CHECKED_STRIDE))
    valid = valid[grid]
    from_depth = np.zeros_like(raw) if depth is None else depth_normals(depth, frame.camera, step=2)
    return Sample(raw[grid][valid], pixel_rays(frame.camera)[grid][valid], from_depth[grid][valid], frame.camera)


def _check_convention(samples: list[Sample], settings: NormalPriorConfig, log: Log) -> None:
    verdict = judge(samples, settings)
    against = "" if verdict.cosine is None else f", mean cosine with the depth prior's normals {verdict.cosine:.2f}"
    found = f"{verdict.away:.0%} of the pixels face away from the camera{against}"
    if verdict.better and settings.check:
        raise InputError(
            f"{settings.path} has its normals in another convention ({found}); {verdict.better} fits best, "
            "or prior.normal.check=false uses them as they are"
        )
    log(f"normal prior: {found}")
    if verdict.better:
        log(f"WARNING: the normals' convention looks wrong, {verdict.better} fits best; used all the same")
    elif verdict.cosine is not None and verdict.cosine < 0.5:
        log("WARNING: depth and normal priors do not agree; one of them or both are poor")


def _some(names: list[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
