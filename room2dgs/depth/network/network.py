"""Inference of a depth or normal network on one photo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from room2dgs.depth.network.card import NetworkFormat
from room2dgs.depth.network.fit import Fit, fitted, input_intrinsics, network_input, photo_part
from room2dgs.depth.network.flip import Prediction, averaged, mirrored_back, mirrored_camera
from room2dgs.depth.network.output import one_channel, raw_map, unit_normals
from room2dgs.depth.network.session import FLOATS, Network, described, shape_in_words
from room2dgs.errors import InputError, first_line
from room2dgs.geometry.camera import Camera

NUMBERS = {**FLOATS, "tensor(int64)": np.int64, "tensor(int32)": np.int32}
# of a map's pixels; so few may be NaN or infinite, and are left out
MAX_NOT_FINITE = 0.01
MASK_THRESHOLD = 0.5
INPUT_SETTINGS = (
    "input", "intrinsics", "tokens", "height", "width", "multiple", "fit", "layout", "channels", "white", "mean", "std",
    "flip",
)  # fmt: skip


def predicted(network: Network, photo: np.ndarray, camera: Camera) -> Prediction:
    """One photo's map, at the size at which the network gives it.

    Args:
        photo: (H, W, 3) uint8 RGB.
        camera: of the photo's size.

    Returns:
        (h, w) float32 depth as the network means it (metres for this photo's focal length where
        `canonical_focal_px` is set) or (h, w, 3) float32 unit normals in the network's axes, (h, w) bool where
        they are valid, and the expected error if the network gives it; for exactly the photo's area.

    Raises:
        InputError: the network cannot run, or gives something that is no such map.
    """
    return predictions([network], photo, camera)[0]


def predictions(networks: Sequence[Network], photo: np.ndarray, camera: Camera) -> list[Prediction]:
    """Several maps of one photo from one inference.

    Args:
        networks: of one session and with the same settings of the input (`same_input`).

    Raises:
        InputError: as `predicted`.
    """
    found = _inferred(networks, photo, camera)
    if networks[0].settings.flip:
        mirrored = _inferred(networks, np.ascontiguousarray(photo[:, ::-1]), mirrored_camera(camera))
        found = [averaged(one, mirrored_back(other)) for one, other in zip(found, mirrored, strict=True)]
    return found


def same_input(one: NetworkFormat, other: NetworkFormat) -> bool:
    """Whether two networks' settings show them the same photo."""
    return all(getattr(one, name) == getattr(other, name) for name in INPUT_SETTINGS)


def _inferred(networks: Sequence[Network], photo: np.ndarray, camera: Camera) -> list[Prediction]:
    network = networks[0]
    settings = network.settings
    fit = input_fit(network, camera)
    dtype = FLOATS[network.image.type]
    feeds = {network.image.name: network_input(photo, fit, settings).astype(dtype)}
    by_name = {arg.name: arg for arg in network.session.get_inputs()}
    if settings.intrinsics:
        feeds[settings.intrinsics] = shaped(input_intrinsics(camera, fit), by_name[settings.intrinsics], network)
    if settings.tokens:
        count = np.array((fit.height // settings.multiple) * (fit.width // settings.multiple))
        feeds[settings.tokens] = shaped(count, by_name[settings.tokens], network)
    names = list(dict.fromkeys(name for network in networks for name in network.outputs))
    try:
        results = network.session.run(names, feeds)
    except Exception as error:  # onnxruntime has a dozen kinds, all plain exceptions
        raise InputError(
            f"{network.path} cannot run on a photo of {fit.width}x{fit.height} ({first_line(error)}); "
            f"it has {described(network.session)}"
        ) from error
    by_name = dict(zip(names, results, strict=True))
    return [decoded(network, by_name, fit, camera) for network in networks]


def decoded(network: Network, results: Mapping[str, np.ndarray], fit: Fit, camera: Camera) -> Prediction:
    """One photo's map from the outputs of an inference.

    Args:
        results: output's name -> array.
        fit: where the photo lies in the input.
        camera: of the photo.

    Raises:
        InputError: they are no such map.
    """
    settings = network.settings
    values = raw_map(network, results[network.outputs[0]], fit)
    valid = np.isfinite(values) if values.ndim == 2 else np.isfinite(values).all(axis=-1)
    if not valid.mean() >= 1.0 - MAX_NOT_FINITE:
        raise InputError(
            f"{network.path} gives NaN or infinite values at {1.0 - valid.mean():.0%} of the pixels of its output "
            f"{network.outputs[0]}; use a 32-bit export, and check white, mean and std in its card"
        )
    values = np.where(valid if values.ndim == 2 else valid[..., None], values, 0.0).astype(np.float32)
    if settings.mask:
        valid &= _beside(network, results, settings.mask, valid.shape) > MASK_THRESHOLD
    error = _beside(network, results, settings.error_output, valid.shape) if settings.error_output else None
    values, valid = photo_part(values, fit), photo_part(valid, fit)
    if error is not None:
        error = photo_part(error, fit)
        valid = valid & (error >= 0)  # NaN is no error
    if network.kind == "normal":
        return Prediction(*unit_normals(network, values, valid), error)
    if settings.canonical_focal_px is not None:
        values = values * np.float32(input_intrinsics(camera, fit)[0, 0] / settings.canonical_focal_px)
    return Prediction(values, valid, error)


def _beside(network: Network, results: Mapping[str, np.ndarray], name: str, shape: tuple[int, ...]) -> np.ndarray:
    """The mask or the error that belongs to a map."""
    values = one_channel(network, results[name], name, None)
    if values.shape != shape:
        raise InputError(f"{network.path} gives {name} as {values.shape} for a map of {shape}; drop one")
    return values


def input_fit(network: Network, camera: Camera) -> Fit:
    """Where a photo lies in the network's input.

    Raises:
        InputError: the input's size is not known, or the card has another.
    """
    settings, shape = network.settings, network.image.shape
    sides = shape[-2:] if settings.layout == "nchw" else shape[-3:-1]
    fixed = [side if isinstance(side, int) and side > 0 else None for side in sides]
    how = "stretch" if settings.fit == "cover" and all(fixed) else settings.fit
    size: list[int] = []
    for name, own in zip(("height", "width"), fixed, strict=True):
        wanted = getattr(settings, name)
        if own is None and wanted is None:
            raise InputError(f"{network.path} takes photos of any {name}; give {network.named(name)} in its card")
        if own is not None and wanted not in (None, own) and settings.fit != "cover":
            raise InputError(
                f"{network.named(name)}={wanted} in the card does not fit {network.path}, whose photos have {name} "
                f"{own}; leave it out"
            )
        size.append(own or wanted)
    return fitted(camera, size[0], size[1], how, settings.multiple)


def shaped(values: np.ndarray, arg: Any, network: Network) -> np.ndarray:
    """An input's values with the type and as many axes as the network wants.

    Raises:
        InputError: it wants something else.
    """
    if arg.type not in NUMBERS or len(arg.shape) < values.ndim:
        raise InputError(
            f"{network.path} wants {arg.name} as {arg.type} of {shape_in_words(arg)}, which numbers of shape "
            f"{values.shape} do not fit; export it with an input of that shape"
        )
    return values.astype(NUMBERS[arg.type]).reshape((1,) * (len(arg.shape) - values.ndim) + values.shape)
