"""All priors of a scene: read, aligned, checked, and every frame without one named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from room2dgs import _C
from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import NormalPriorConfig, OnnxConfig, PriorConfig
from room2dgs.depth.align.depths import aligned_depths
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.completion.correction import Correct, correction_by_network
from room2dgs.depth.completion.free_space import FreeSpace, free_space, less_where_seen_through, rays_to
from room2dgs.depth.completion.planes import Plane
from room2dgs.depth.completion.views import complete_views
from room2dgs.depth.confidence import has_confidence, read_confidence
from room2dgs.depth.files import find_map, read_normal
from room2dgs.depth.joint.depths import logged_joint_depths
from room2dgs.depth.network.maps import predicted_maps, read_models
from room2dgs.depth.network.model_file import ModelFile
from room2dgs.depth.normals.check import usable
from room2dgs.depth.normals.convention import camera_normals
from room2dgs.depth.normals.samples import sample
from room2dgs.depth.sensor.depths import sensor_depths
from room2dgs.depth.simulated import simulated
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.parallel_map import parallel_map
from room2dgs.stereo.depth_samples import DepthSamples
from room2dgs.stereo.passes import FirstPass, StereoMaps

CHECKED_FRAMES = 24
Timed = Callable[[str], AbstractContextManager[None]]
HALF_WORTH = 0.1  # median relative residual at the points that halves the confidence in a map


class Priors(NamedTuple):
    """What `load_priors` found.

    Attributes:
        by_frame: frame name -> maps, for the frames that have one; in the frames' cache.
        fits: frame name -> its depth's alignment, for every frame with a depth map, left out or not.
        label: "simulated" if any map says so, else the sources: "room_prior", "room_prior+sensor", "files", or "none".
        networks: "depth" and "normal" -> digest of the model that made the maps (`ModelFile.digest`).
        depth_source: where depth comes from, "auto" decided: "sensor", "room_prior", "files", "onnx" or "none".
        planes: the room's planes that completion drew depth to.
        stereo: frame name -> stereo's depth, metres, 0 = none, and how many consistent views it counts as; of the
            last pass.
    """

    by_frame: StoredMaps
    fits: dict[str, Fit]
    label: str
    networks: dict[str, str]
    depth_source: str
    planes: tuple[Plane, ...] = ()
    stereo: StereoMaps = MappingProxyType({})


def load_priors(
    frames: Sequence[Frame],
    points: PointCloud,
    config: PriorConfig,
    log: Log = print,
    compare: Callable[[FirstPass | None], DepthSamples] | None = None,
    timed: Timed = nullcontext,
    correct: Correct | None = None,
) -> Priors:
    """Read and align the priors of some frames.

    Args:
        frames: training views.
        points: the scene's sparse points, metres.
        config: sources and conventions.
        log: takes one line at a time.
        compare: finds stereo's points, at the first look and, with what that came to, at the second; called if there
            are depth maps that they could hold in place.
        timed: gives, for a stage's name, what to do that stage in: "stereo", "maps" (read or predicted, and aligned),
            "joint" and "completion".
        correct: corrects what completion has made of the views that stereo has seen; None: what the settings say.

    Raises:
        InputError: no map for any frame, an unusable map, or normals in another convention than configured.
    """
    depth_settings, sensor = sensor_depths(frames, points, config.depth, log)
    config = replace(config, depth=depth_settings)
    settings = config.depth
    models = read_models(config)
    label = _label(config, log)
    compare = compare if settings.joint and not sensor and settings.source != "none" else None
    if compare and settings.completion and settings.correction:
        correct = correct or correction_by_network()
    stored = StoredMaps(next((frame.cache for frame in frames if frame.cache), None))
    depths: LazyMaps[np.ndarray] = LazyMaps()
    confidences: LazyMaps[np.ndarray] = LazyMaps()
    fits: dict[str, Fit] = {}
    planes: list[Plane] = []
    files: Mapping[str, Path] = {}
    held = Held(points, {}, None)

    def take(name: str, depth: np.ndarray, confidence: np.ndarray | None = None) -> None:
        confidence = _where(depth > 0, confidences.get(name) if confidence is None else confidence)
        maps = stored.get(name, ViewMaps(source=label))
        stored.put(name, maps._replace(depth=depth, depth_confidence=confidence))

    for look in range(settings.passes if compare else 1):
        if compare:
            with timed("stereo"):
                first = FirstPass(_stored_depths(stored), held.fine) if look else None
                held = Held(points, {}, None)  # the first look's points need not be there during the second
                held = _held(compare(first), frames, settings.free_space)
        with timed("maps"):
            if sensor:
                depths, confidences, fits = sensor
            elif settings.source != "none":
                files = files or _maps(frames, config, "depth", models, log)
                depths, fits = aligned_depths(frames, files, held.points, settings, log)
                confidences = _confidences({name: files[name] for name in depths}, settings.onnx)
            if config.normal.source != "none" and not look:
                for name, normal, confidence in _normals(frames, depths, held.points, config, models, log):
                    stored.put(name, ViewMaps(normal=normal, normal_confidence=confidence, source=label))
        if not (settings.joint and depths and len(held.points)):
            break
        normals, normal_confidences = _stored_normals(stored)
        both = (confidences, normal_confidences)
        with timed("joint"):
            depths = logged_joint_depths(frames, depths, normals, held.points, settings.manhattan, log, both)
        if settings.completion:
            misfits = {name: fit.residual for name, fit in fits.items()}
            with timed("completion"):
                planes = complete_views(
                    frames,
                    depths,
                    confidences,
                    normals,
                    normal_confidences,
                    held.points,
                    held.fine,
                    misfits,
                    log,
                    take,
                    planes=settings.planes,
                    right_angles=settings.right_angles,
                    creases=settings.creases,
                    other_views=settings.other_views,
                    space=held.space,
                    correct=correct,
                )
            depths = {}
    if settings.joint and depths and not len(held.points):
        log("depth prior: no point holds it, so it is used as it is, neither optimised jointly nor completed")
    for name, depth in depths.items():
        take(name, depth, _by_fit(depth, confidences.get(name), fits.get(name)))
    networks = {kind: model.digest for kind, model in models.items()}
    return Priors(stored, fits, label, networks, settings.source, tuple(planes))


class Held(NamedTuple):
    """What holds the depth in place.

    Attributes:
        points: sparse points and stereo's, those that others look through trusted less.
        fine: stereo's maps, as in `DepthSamples`.
        space: what the views look through; None: not asked.
    """

    points: PointCloud
    fine: StereoMaps
    space: FreeSpace | None


def _held(found: DepthSamples, frames: Sequence[Frame], ask_space: bool) -> Held:
    if not ask_space:
        return Held(found.points, found.maps, None)
    space = free_space([rays_to(found.points, frame) for frame in frames])
    return Held(less_where_seen_through(found.points, space), found.maps, space)


def _stored_depths(stored: StoredMaps) -> LazyMaps[np.ndarray]:
    depths: LazyMaps[np.ndarray] = LazyMaps()
    for name, maps in stored.items():
        if maps.depth is not None:
            depths.add(name, partial(_stored_map, stored, name, "depth"))
    return depths


def _label(config: PriorConfig, log: Log) -> str:
    parts = [part for part in (config.depth, config.normal) if part.source != "none"]
    if any(part.source == "files" and simulated(Path(part.path or "")) for part in parts):
        log("simulated priors: made from ground truth, for studies only")
        return "simulated"
    return "+".join(sorted({part.source for part in parts})) or "none"


def _stored_normals(stored: StoredMaps) -> tuple[LazyMaps[np.ndarray], LazyMaps[np.ndarray]]:
    """Normals and their confidences, of the views that have them."""
    normals: LazyMaps[np.ndarray] = LazyMaps()
    confidences: LazyMaps[np.ndarray] = LazyMaps()
    for name, maps in stored.items():
        if maps.normal is not None:
            normals.add(name, partial(_stored_map, stored, name, "normal"))
        if maps.normal_confidence is not None:
            confidences.add(name, partial(_stored_map, stored, name, "normal_confidence"))
    return normals, confidences


def _stored_map(stored: StoredMaps, name: str, kind: str) -> np.ndarray:
    return getattr(stored[name], kind)


def _maps(
    frames: Sequence[Frame], config: PriorConfig, kind: str, models: Mapping[str, ModelFile], log: Log
) -> dict[str, Path]:
    """Frame name -> file; the missing ones are logged."""
    settings = getattr(config, kind)
    if kind in models:
        return predicted_maps(frames, kind, config, models, log)
    folder = Path(settings.path or "")
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give prior.{kind}.path=DIR with a map for each photo")
    found = {frame.name: file for frame in frames if (file := find_map(folder, frame))}
    if not found:
        raise InputError(
            f"{folder} has no map for any of the {len(frames)} views; name them as the views, "
            f"for example {frames[0].name}.png or .npy"
        )
    missing = [frame.name for frame in frames if frame.name not in found]
    if missing:
        log(f"{kind} prior: no map for {len(missing)} of {len(frames)} views: {_some(missing)}")
    return found


def _confidences(files: Mapping[str, Path], settings: OnnxConfig) -> LazyMaps[np.ndarray]:
    """Frame name -> (H, W) float32, for the maps that have one."""
    found: LazyMaps[np.ndarray] = LazyMaps()
    for name, path in files.items():
        if has_confidence(path):
            found.add(name, partial(read_confidence, path, settings))
    return found


def _by_fit(depth: np.ndarray, confidence: np.ndarray | None, fit: Fit | None) -> np.ndarray | None:
    """A map that is off the points that its own photo sees is worth less."""
    if fit is None or not np.isfinite(fit.residual):
        return confidence
    worth = np.float32(1 / (1 + (fit.residual / HALF_WORTH) ** 2))
    return worth * (np.ones(depth.shape, np.float32) if confidence is None else confidence)


def _where(valid: np.ndarray, confidence: np.ndarray | None) -> np.ndarray | None:
    return None if confidence is None else np.where(valid, confidence, np.float32(0))


def _normals(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    points: PointCloud,
    config: PriorConfig,
    models: Mapping[str, ModelFile],
    log: Log,
) -> Iterator[tuple[str, np.ndarray, np.ndarray | None]]:
    """Frame name, (H, W, 3) float32 unit world normals facing the camera, 0 = invalid, and their confidence."""
    settings = config.normal
    network = "normal" in models
    # The check comes first: a wrong convention is reported before all maps are read, let alone computed.
    some = frames[:: max(1, len(frames) // CHECKED_FRAMES)] if network else frames
    files = _maps(some, config, "normal", models, log)
    some = [frame for frame in some if frame.name in files]
    samples = [
        sample(
            *read_normal(files[frame.name], settings, frame.camera),
            depths.get(frame.name),
            frame.camera,
            seen_points(points, frame),
        )
        for frame in some[:: max(1, len(some) // CHECKED_FRAMES)]
    ]
    if not usable(samples, points.xyz, settings, models["normal"].path if network else settings.path, log):
        return
    files = _maps(frames, config, "normal", models, log) if network else files
    frames = [frame for frame in frames if frame.name in files]
    used = 0
    read = parallel_map(lambda frame: _normal(frame, files[frame.name], settings), frames, _C.threads())
    for frame, (normal, confidence) in zip(frames, read, strict=True):
        if normal.any():
            used += 1
            yield frame.name, normal, confidence
        else:
            log(f"normal prior of {frame.name} left out: no pixel of it faces the camera")
    log(f"normal prior: {used} of {len(frames)} maps used")


def _normal(frame: Frame, path: Path, settings: NormalPriorConfig) -> tuple[np.ndarray, np.ndarray | None]:
    """(H, W, 3) float32 unit world normals facing the camera, 0 = invalid, and their confidence."""
    raw, valid = read_normal(path, settings, frame.camera)
    confidence = read_confidence(path, settings.onnx)
    if confidence is not None:
        valid &= confidence > 0
    in_cam = camera_normals(raw, settings, frame.camera)
    # A surface that is seen faces the camera; where a map says otherwise it is wrong.
    valid &= (in_cam * frame.camera.rays()).sum(axis=-1) < 0
    in_world = frame.camera.turned_to_world(in_cam)
    return np.where(valid[..., None], in_world, 0.0).astype(np.float32), _where(valid, confidence)


def _some(names: list[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
