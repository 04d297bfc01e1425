"""Maps of all photos by a network; what the map cache has is not computed again."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Event

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.config import NETWORK_SOURCES, PriorConfig
from room2dgs.config.card import card_of
from room2dgs.cores import available_cores
from room2dgs.depth.files import resize_depth, resize_normal
from room2dgs.depth.network.card import NetworkFormat, format_of
from room2dgs.depth.network.flip import Prediction
from room2dgs.depth.network.map_cache import SUFFIX, is_cached, is_empty, write_map
from room2dgs.depth.network.model_file import ModelFile, read_model
from room2dgs.depth.network.network import predictions, same_input
from room2dgs.depth.network.session import Network, open_network, runs_on_gpu
from room2dgs.depth.network.shipped import model_path
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log

KINDS = ("depth", "normal")
# Raise it when a map of the same photo by the same network would come out differently.
FORMAT = 2
REPORT_SECONDS = 30.0
LARGE_MB = 100.0  # of the file of a network that runs on one photo at a time
MOST_AT_ONCE = 4


def read_models(config: PriorConfig) -> dict[str, ModelFile]:
    """Kind -> model, for the kinds of prior that a network makes.

    Raises:
        InputError: as `read_model`, `model_path` and `card_of`.
    """
    parts = {kind: getattr(config, kind) for kind in KINDS}
    return {
        kind: read_model(model_path(part), card_of(part, kind).sha256)
        for kind, part in parts.items()
        if part.source in NETWORK_SOURCES
    }


def predicted_maps(
    frames: Sequence[Frame],
    kind: str,
    config: PriorConfig,
    models: Mapping[str, ModelFile],
    log: Log,
    stop: Event | None = None,
) -> dict[str, Path]:
    """Depth or normal maps of some photos by the configured network.

    A map is known by the bytes of the model and of the photo, by the settings that matter, and by its size. It is
    cached as `write_map` writes it, at the frame's camera's size, so that `read_depth` and `read_normal` read it. The
    model is not loaded when all maps are there. Where one model gives both kinds from the same input, a photo that
    lacks this kind gets both from one inference.

    Args:
        kind: "depth" or "normal".
        config: `cache` is the folder of the map cache.
        models: what `read_models` gives.
        log: takes one line at a time.
        stop: once it is set, photos that are not begun are left out.

    Returns:
        Frame name -> file; without the photos for which the network has no valid pixel, which are logged.

    Raises:
        InputError: as `open_network` and `predictions`, the folder cannot be written, or the network has no
            valid pixel for any photo.
    """
    if not config.cache:
        raise InputError("prior.cache=DIR is not given; the networks' maps are cached there")
    model, folder = models[kind], Path(config.cache) / kind
    paths = _paths(frames, kind, config, model)
    missing = [frame for frame in frames if not is_cached(paths[frame.name], _shape(frame, kind))]
    if missing:
        log(
            f"{kind} prior: {model.path.name} on {len(missing)} photos; {len(frames) - len(missing)} of its maps "
            f"are in {folder}"
        )
        _fill(missing, _same_inference(kind, config, models), config, model, log, stop or Event())
    else:
        log(f"{kind} prior: all {len(frames)} maps of {model.path.name} are in {folder}")
    empty = [name for name, path in paths.items() if is_empty(path)]
    if len(empty) == len(frames):
        raise InputError(
            f"{model.path} gives no valid pixel for any of {len(frames)} photos; check what its maker says of white, "
            "mean and std in its card"
        )
    if empty:
        some = ", ".join(empty[:5])
        log(f"{kind} prior: the network has no valid pixel in {len(empty)} of {len(frames)} photos: {some}")
    return {name: path for name, path in paths.items() if name not in empty}


def _same_inference(kind: str, config: PriorConfig, models: Mapping[str, ModelFile]) -> list[str]:
    """This kind first, then the other if the same inference gives it."""
    settings = format_of(getattr(config, kind), kind)
    return [kind] + [
        other
        for other, model in models.items()
        if other != kind
        and model.digest == models[kind].digest
        and same_input(format_of(getattr(config, other), other), settings)
    ]


def _fill(
    frames: Sequence[Frame], kinds: Sequence[str], config: PriorConfig, model: ModelFile, log: Log, stop: Event
) -> None:
    """Make the maps of some photos; the first kind is missing for all of them."""
    at_once, threads = photos_at_once(model, config)
    networks: list[Network] = []
    for kind in kinds:
        session = networks[0].session if networks else None
        settings = format_of(getattr(config, kind), kind)
        networks.append(open_network(model.path, kind, settings, threads, config.provider, session))
    paths = {kind: _paths(frames, kind, config, model) for kind in kinds}
    start = time.monotonic()

    def make(frame: Frame) -> None:
        if not stop.is_set():
            _make(frame, networks, {kind: paths[kind][frame.name] for kind in kinds})

    with ThreadPoolExecutor(at_once) as pool:
        try:
            _log_progress(pool.map(make, frames), kinds[0], len(frames), log)
        except BaseException:
            stop.set()
            raise
    if stop.is_set():
        return
    seconds = time.monotonic() - start
    log(
        f"{' and '.join(kinds)} prior: {len(frames)} photos in {seconds:.1f} s, "
        f"{1000 * seconds / len(frames):.0f} ms each"
    )


def _make(frame: Frame, networks: Sequence[Network], paths: Mapping[str, Path]) -> None:
    """One photo's maps of all kinds, of which some may be there already."""
    for (kind, path), found in zip(paths.items(), predictions(networks, *full_photo(frame)), strict=True):
        if is_cached(path, _shape(frame, kind)):
            continue
        try:
            write_map(path, *at_camera(found, frame.camera))
        except OSError as error:
            raise InputError(
                f"{path.parent} cannot be written ({error.strerror}); choose another prior.cache=DIR"
            ) from error


def _log_progress(made: Iterable[None], kind: str, count: int, log: Log) -> None:
    start = reported = time.monotonic()
    for done, _ in enumerate(made, start=1):
        if time.monotonic() - reported > REPORT_SECONDS:
            reported = time.monotonic()
            log(f"{kind} prior: {done} of {count} photos, {(reported - start) / done:.1f} s each")


def photos_at_once(model: ModelFile, config: PriorConfig) -> tuple[int, int]:
    """How many photos a network runs on side by side on the CPU, and with how many threads each.

    Small networks gain little from a second thread, large ones need their memory for one photo.
    """
    threads = config.threads or available_cores()
    small = model.bytes < LARGE_MB * 1e6 and not runs_on_gpu(config.provider)
    at_once = min(threads, MOST_AT_ONCE) if small else 1
    return at_once, threads // at_once


def at_camera(found: Prediction, camera: Camera) -> Prediction:
    """A map at the size that the run works at."""
    values, valid, error = found
    if values.ndim == 3:
        values, valid = resize_normal(values, valid, camera)
    else:
        valid = valid & (values != 0)
        values, valid = resize_depth(np.where(valid, values, 0.0), valid, camera)
    if error is not None:
        error = cv2.resize(error, (camera.width, camera.height), interpolation=cv2.INTER_LINEAR)
    return Prediction(values, valid, error)


def full_photo(frame: Frame) -> tuple[np.ndarray, Camera]:
    """The photo at its full size, whatever size the run works at, and its camera."""
    size = frame.full_size()
    if size == (frame.camera.width, frame.camera.height):
        return frame.color(), frame.camera
    camera = frame.camera.resized(*size)
    return replace(frame, camera=camera, cache=None).color(), camera  # seen once, at a size that nothing else asks for


def _paths(frames: Sequence[Frame], kind: str, config: PriorConfig, model: ModelFile) -> dict[str, Path]:
    folder, settings = Path(config.cache or "") / kind, format_of(getattr(config, kind), kind)
    gpu = runs_on_gpu(config.provider)
    return {frame.name: folder / f"{frame.name}-{_key(frame, kind, model, settings, gpu)}{SUFFIX}" for frame in frames}


def _shape(frame: Frame, kind: str) -> tuple[int, ...]:
    size = (frame.camera.height, frame.camera.width)
    return (*size, 3) if kind == "normal" else size


def _key(frame: Frame, kind: str, model: ModelFile, settings: NetworkFormat, gpu: bool) -> str:
    """Sixteen hex digits that stand for all that a map depends on."""
    sees_focal = settings.intrinsics or settings.canonical_focal_px is not None
    K = frame.camera.K.tolist() if sees_focal else None
    photo = frame.digest().hex()
    read = dataclasses.asdict(settings)
    known = [FORMAT, kind, model.digest, read, photo, _shape(frame, kind), K, *(["gpu"] if gpu else [])]
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()[:16]
