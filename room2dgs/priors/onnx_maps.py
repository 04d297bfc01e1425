"""Every photo's map by a network, kept on disk: what is there already is not computed again."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from room2dgs.config import OnnxConfig, PriorConfig
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.priors.files import resize_depth, resize_normal
from room2dgs.priors.onnx_file import ModelFile, read_model
from room2dgs.priors.onnx_network import predicted
from room2dgs.priors.onnx_session import Network, open_network
from room2dgs.scene.camera import Camera
from room2dgs.scene.image_files import color_size
from room2dgs.scene.scene import Frame

Log = Callable[[str], None]
# Raise it when a map of the same photo by the same network would come out differently.
FORMAT = 1
# Settings that change no map.
_OUTSIDE = ("model", "get", "sha256")
# In place of a map: the network saw nothing valid in the photo.
_NOTHING = ".nothing"
_REPORT_SECONDS = 30.0


def predicted_maps(frames: Sequence[Frame], kind: str, config: PriorConfig, log: Log) -> dict[str, Path]:
    """Depth or normal maps of some photos by the configured network.

    A map is known by the bytes of the model and of the photo, by the settings that matter, and by its size. It
    is a .npy of (H, W) or (H, W, 3), float16 where that keeps three digits, 0 = invalid, at the frame's camera's
    size, so that `read_depth` and `read_normal` read it. The model is not loaded when all maps are there.

    Args:
        kind: "depth" or "normal".
        config: `cache` is the folder to keep the maps in.
        log: takes one line at a time.

    Returns:
        Frame name -> file; without the photos in which the network sees nothing, which are logged.

    Raises:
        InputError: as `read_model`, `open_network` and `predicted`, the folder cannot be written, or the network
            sees nothing in any photo.
    """
    settings: OnnxConfig = getattr(config, kind).onnx
    if not config.cache:
        raise InputError("prior.cache=DIR is not given; the networks' maps are kept there")
    model = read_model(Path(settings.model or ""), settings.sha256)
    folder = Path(config.cache) / kind
    paths = {frame.name: folder / f"{frame.name}-{_key(frame, kind, model, settings)}.npy" for frame in frames}
    missing = [frame for frame in frames if not _kept(paths[frame.name], _shape(frame, kind))]
    if missing:
        log(
            f"{kind} prior: {model.path.name} on {len(missing)} photos; {len(frames) - len(missing)} of its maps "
            f"are in {folder}"
        )
        network = open_network(model.path, kind, settings, config.threads, config.provider)
        _fill(network, kind, missing, paths, log)
    else:
        log(f"{kind} prior: all {len(frames)} maps of {model.path.name} are in {folder}")
    empty = [name for name, path in paths.items() if path.with_suffix(_NOTHING).exists()]
    if len(empty) == len(frames):
        raise InputError(
            f"{model.path} gives no valid pixel for any of {len(frames)} photos; check what its maker says of white, "
            f"mean and std, prior.{kind}.onnx.*"
        )
    if empty:
        log(f"{kind} prior: the network sees nothing in {len(empty)} of {len(frames)} photos: {', '.join(empty[:5])}")
    return {name: path for name, path in paths.items() if name not in empty}


def _fill(network: Network, kind: str, frames: Sequence[Frame], paths: dict[str, Path], log: Log) -> None:
    start = reported = time.monotonic()
    for count, frame in enumerate(frames):
        if time.monotonic() - reported > _REPORT_SECONDS:
            reported = time.monotonic()
            log(f"{kind} prior: {count} of {len(frames)} photos, {(reported - start) / count:.1f} s each")
        photo, camera = _photo(frame)
        values, valid = predicted(network, photo, camera)
        if kind == "normal":
            values, valid = resize_normal(values, valid, frame.camera)
        else:
            valid &= values != 0
            values, valid = resize_depth(np.where(valid, values, 0.0), valid, frame.camera)
        try:
            _keep(paths[frame.name], values, valid)
        except OSError as error:
            raise InputError(
                f"{paths[frame.name].parent} cannot be written ({error.strerror}); choose another prior.cache=DIR"
            ) from error
    seconds = time.monotonic() - start
    log(f"{kind} prior: {len(frames)} maps in {seconds:.1f} s, {1000 * seconds / len(frames):.0f} ms each")


def _photo(frame: Frame) -> tuple[np.ndarray, Camera]:
    """The photo at its full size, whatever size the run works at, and its camera."""
    camera = frame.camera.resized(*color_size(frame.color_path))
    return replace(frame, camera=camera).color(), camera


def _shape(frame: Frame, kind: str) -> tuple[int, ...]:
    size = (frame.camera.height, frame.camera.width)
    return (*size, 3) if kind == "normal" else size


def _key(frame: Frame, kind: str, model: ModelFile, settings: OnnxConfig) -> str:
    """Sixteen hex digits that stand for all that a map depends on."""
    matters = {name: value for name, value in dataclasses.asdict(settings).items() if name not in _OUTSIDE}
    sees_focal = settings.intrinsics or settings.canonical_focal_px is not None
    K = frame.camera.K.tolist() if sees_focal else None
    photo = hashlib.sha256(frame.color_path.read_bytes()).hexdigest()
    known = [FORMAT, kind, model.digest, matters, photo, _shape(frame, kind), K]
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()[:16]


def _kept(path: Path, shape: tuple[int, ...]) -> bool:
    """Whether a map is there and whole."""
    if path.with_suffix(_NOTHING).exists():
        return True
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False).shape == shape
    except (OSError, ValueError, EOFError):
        return False


def _keep(path: Path, values: np.ndarray, valid: np.ndarray) -> None:
    if not valid.any() or not values[valid].any():
        with whole_file(path.with_suffix(_NOTHING)) as temporary:
            temporary.write_bytes(b"")
        return
    values = np.where(valid if values.ndim == 2 else valid[..., None], values, 0.0).astype(np.float32)
    with np.errstate(over="ignore"):
        half = values.astype(np.float16)
    scale = np.abs(values) if values.ndim == 2 else 1.0
    close = np.abs(half.astype(np.float32) - values) <= 1e-3 * scale
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.save(file, half if close.all() else values)
