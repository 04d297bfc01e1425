"""Normals as a stage: their convention is checked on a few photos, then all are read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from room2dgs import _C
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.captures.uncertainty import measured_weight
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import NormalPriorConfig
from room2dgs.depth.network.model_file import ModelFile
from room2dgs.depth.normals.check import usable
from room2dgs.depth.normals.convention import camera_normals
from room2dgs.depth.normals.samples import sample
from room2dgs.depth.sources.source import NormalMap, NormalMaps, SourceInput
from room2dgs.depth.state import DepthSettings, DepthState, stored
from room2dgs.logs import Log
from room2dgs.parallel_map import parallel_map
from room2dgs.registries.depth_sources import DEPTH_SOURCES

CHECKED_FRAMES = 24


def read_normals(state: DepthState, settings: DepthSettings) -> DepthState:
    """Store the normals of all photos and their weights; the second pass has those of the first.

    Raises:
        InputError: no map for any frame, an unusable map, or normals in another convention than configured.
    """
    config = state.proposed.prior.normal
    if config.source == "none" or state.pass_number:
        return state
    source = DEPTH_SOURCES.load(config.source)
    with settings.timed("maps"):
        # The check comes first: a wrong convention is reported before all maps are read, let alone computed.
        network = state.proposed.models.get("normal")
        some = _every(list(state.frames)) if network else list(state.frames)
        found = source.normals(_input(state, some, settings.log))
        if not _are_usable(state, [frame for frame in some if frame.name in found], found, network, settings.log):
            return state
        if network:
            found = source.normals(_input(state, list(state.frames), settings.log))
        frames = [frame for frame in state.frames if frame.name in found]
        used = 0
        for name, normal, weight in _in_world(frames, found, config, settings.log):
            used += 1
            state.maps.put(name, ViewMaps(normal=normal, normal_confidence=weight, source=state.proposed.label))
        settings.log(f"normal prior: {used} of {len(frames)} maps used")
    return replace(state, normals=stored(state.maps, "normal"), normal_weights=stored(state.maps, "normal_confidence"))


def _input(state: DepthState, frames: list[Frame], log: Log) -> SourceInput:
    return SourceInput(frames, state.sparse, state.proposed.prior, state.proposed.models, log)


def _every(frames: list[Frame]) -> list[Frame]:
    """About `CHECKED_FRAMES` of them, evenly."""
    return frames[:: max(1, len(frames) // CHECKED_FRAMES)]


def _are_usable(state: DepthState, frames: list[Frame], found: NormalMaps, network: ModelFile | None, log: Log) -> bool:
    config = state.proposed.prior.normal
    samples = []
    for frame in _every(frames):
        normal, valid, _ = found[frame.name]
        seen = seen_points(state.samples, frame)
        samples.append(sample(normal, valid, state.depths.get(frame.name), frame.camera, seen))
    made_of = str(network.path) if network else config.path
    return usable(samples, state.samples.xyz, config, made_of, log)


def _in_world(
    frames: list[Frame], found: NormalMaps, config: NormalPriorConfig, log: Log
) -> Iterator[tuple[str, np.ndarray, np.ndarray | None]]:
    """Frame name, (H, W, 3) float32 unit world normals facing the camera, 0 = invalid, and their weights."""
    read = parallel_map(lambda frame: _normal(frame, found[frame.name], config), frames, _C.threads())
    for frame, (normal, weight) in zip(frames, read, strict=True):
        if normal.any():
            yield frame.name, normal, weight
        else:
            log(f"normal prior of {frame.name} left out: no pixel of it faces the camera")


def _normal(frame: Frame, found: NormalMap, config: NormalPriorConfig) -> tuple[np.ndarray, np.ndarray | None]:
    raw, valid, sigma = found
    weight = None if sigma is None else measured_weight(sigma, config.error_scale, config.max_error)
    if weight is not None:
        valid = valid & (weight > 0)
    in_cam = camera_normals(raw, config, frame.camera)
    # A surface that is seen faces the camera; where a map says otherwise it is wrong.
    valid = valid & ((in_cam * frame.camera.rays()).sum(axis=-1) < 0)
    in_world = frame.camera.turned_to_world(in_cam)
    normal = np.where(valid[..., None], in_world, 0.0).astype(np.float32)
    return normal, None if weight is None else np.where(valid, weight, np.float32(0))
