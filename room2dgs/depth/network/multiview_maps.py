"""Depth of all photos by a network that sees several at a time; what the map cache has is not computed again."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.config import PriorConfig
from room2dgs.config.card import Card, card_of
from room2dgs.depth.network.map_cache import SUFFIX, is_cached, is_empty, write_map
from room2dgs.depth.network.maps import REPORT_SECONDS, at_camera, full_photo
from room2dgs.depth.network.model_file import ModelFile
from room2dgs.depth.network.multiview import MultiviewNetwork, open_multiview, window_maps
from room2dgs.depth.network.session import runs_on_gpu
from room2dgs.depth.network.windows import Window, windows
from room2dgs.errors import InputError
from room2dgs.logs import Log

# Raise it when a map of the same window by the same network would come out differently.
FORMAT = 1
FOLDER = "multiview"


def multiview_maps(frames: Sequence[Frame], config: PriorConfig, model: ModelFile, log: Log) -> dict[str, Path]:
    """Depth maps of some photos; a map is known by all that its window's network reads.

    Args:
        config: `cache` is the folder of the map cache.
        log: takes one line at a time.

    Returns:
        Frame name -> file as `write_map` writes it, at the frame's camera's size; without the photos for which the
        network has no valid pixel, which are logged.

    Raises:
        InputError: as `open_multiview` and `window_maps`, there are fewer photos than a window has, the folder cannot
            be written, or the network has no valid pixel for any photo.
    """
    if not config.cache:
        raise InputError("prior.cache=DIR is not given; the networks' maps are cached there")
    card, folder = card_of(config.depth, "depth"), Path(config.cache) / FOLDER
    net = open_multiview(model.path, card, config.threads, config.provider)
    if len(frames) < net.photos:
        raise InputError(
            f"{model.path} sees {net.photos} photos at a time and there are {len(frames)}; take more, or an export for "
            "fewer"
        )
    assert card.views is not None
    chosen = windows([frame.camera for frame in frames], net.photos, card.views.answers)
    gpu = runs_on_gpu(config.provider)
    paths = {
        index: folder / f"{frames[index].name}-{_key(frames, window, index, model, card, gpu)}{SUFFIX}"
        for window in chosen
        for index in window.answers
    }
    missing = [one for one in chosen if not all(_there(frames[index], paths[index]) for index in one.answers)]
    log(
        f"depth prior: {model.path.name} on {len(frames)} photos, {net.photos} at a time: {len(missing)} of "
        f"{len(chosen)} windows, the others' maps are in {folder}"
    )
    _fill(frames, missing, paths, net, log)
    empty = [frames[index].name for index, path in paths.items() if is_empty(path)]
    if len(empty) == len(frames):
        raise InputError(
            f"{model.path} gives no valid pixel for any of {len(frames)} photos; check what its maker says of white, "
            "mean and std in its card"
        )
    if empty:
        log(f"depth prior: the network has no valid pixel in {len(empty)} of {len(frames)} photos: {empty[0]} ...")
    return {frames[index].name: path for index, path in sorted(paths.items()) if frames[index].name not in empty}


def _fill(
    frames: Sequence[Frame], missing: Sequence[Window], paths: dict[int, Path], net: MultiviewNetwork, log: Log
) -> None:
    start = reported = time.monotonic()
    for done, window in enumerate(missing, start=1):
        photos, cameras = zip(*(full_photo(frames[index]) for index in window.views), strict=True)
        for index, found in zip(window.views, window_maps(net, photos, cameras), strict=False):
            if index not in window.answers:
                continue
            try:
                write_map(paths[index], *at_camera(found, frames[index].camera))
            except OSError as error:
                raise InputError(
                    f"{paths[index].parent} cannot be written ({error.strerror}); choose another prior.cache=DIR"
                ) from error
        if time.monotonic() - reported > REPORT_SECONDS:
            reported = time.monotonic()
            log(f"depth prior: {done} of {len(missing)} windows, {(reported - start) / done:.1f} s each")


def _there(frame: Frame, path: Path) -> bool:
    return is_cached(path, (frame.camera.height, frame.camera.width))


def _key(frames: Sequence[Frame], window: Window, index: int, model: ModelFile, card: Card, gpu: bool) -> str:
    """Sixteen hex digits that stand for all that a map depends on."""
    seen = [
        [frames[view].digest().hex(), frames[view].camera.K.tolist(), frames[view].camera.size,
         np.asarray(frames[view].camera.cam_from_world).tolist()]
        for view in window.views
    ]  # fmt: skip
    read = [dataclasses.asdict(part) for part in (card.input, card.views, card.depth) if part is not None]
    known = [FORMAT, model.digest, read, seen, window.views.index(index), *(["gpu"] if gpu else [])]
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()[:16]
