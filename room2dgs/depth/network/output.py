"""What a network gives, as a map: depth or unit normals, or a sentence on what it is instead."""

from __future__ import annotations

import numpy as np

from room2dgs.depth.network.fit import Fit
from room2dgs.depth.network.session import Network
from room2dgs.errors import InputError

# relative difference of the aspect ratios of a network's output and its input
MAX_ASPECT_MISMATCH = 0.05
# An output with more axes than height and width: at most so many channels.
MAX_CHANNELS = 4
# The median length of what are normals; networks do not all normalise them.
NORMAL_LENGTHS = (0.6, 1.5)


def raw_map(network: Network, result: np.ndarray, fit: Fit) -> np.ndarray:
    """An output as (h, w) depth or (h, w, 3) normals with the input's aspect."""
    name = network.outputs[0]
    if network.kind == "normal":
        values = _channels_last(network, result, name)
        if values.shape[2] not in (3, 4):  # a fourth is the network's own confidence
            raise _no_map(network, result, name, "normals have three channels, and one is what depth has")
        values = values[..., :3]
    else:
        values = one_channel(network, result, name, network.settings.output_channel)
    if abs(values.shape[1] * fit.height / (values.shape[0] * fit.width) - 1.0) > MAX_ASPECT_MISMATCH:
        raise _no_map(network, result, name, f"that is another shape than the photo's {fit.height} x {fit.width}")
    return values


def one_channel(network: Network, result: np.ndarray, name: str, channel: int | None) -> np.ndarray:
    """One channel of an output, (h, w) float32."""
    values = _channels_last(network, result, name)
    if channel is None and values.shape[2] == 1:
        channel = 0
    if channel is None:
        raise _no_map(
            network, result, name,
            f"a depth map has one channel; three may be normals, or give {network.named('output_channel')} in its card",
        )  # fmt: skip
    if channel >= values.shape[2]:
        raise _no_map(network, result, name, f"there is no channel {channel}")
    return values[..., channel]


def unit_normals(network: Network, values: np.ndarray, valid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals of unit length; what is far shorter than the others is invalid."""
    if network.settings.values == "zero_to_one":
        values = 2.0 * values - 1.0
    length = np.linalg.norm(values, axis=-1)
    median = float(np.median(length[valid])) if valid.any() else 1.0
    if not NORMAL_LENGTHS[0] <= median <= NORMAL_LENGTHS[1]:
        raise InputError(
            f"{network.path} gives {network.outputs[0]} with vectors of length {median:.2f}, no normals; they may be "
            f"stored otherwise ({network.named('values')} in its card: signed or zero_to_one), or it is another output"
        )
    valid = valid & (length > 0.5 * NORMAL_LENGTHS[0])
    unit = values / np.where(valid, length, 1.0)[..., None]
    return np.where(valid[..., None], unit, 0.0).astype(np.float32), valid


def _channels_last(network: Network, result: np.ndarray, name: str) -> np.ndarray:
    """(h, w, channels) float32 of an output of two to four axes."""
    if result.dtype.kind not in "fiub" or not result.size:
        raise _no_map(network, result, name, "a map is an array of numbers")
    values = result.astype(np.float32)
    if values.ndim == 4 and values.shape[0] == 1:
        values = values[0]
    if values.ndim == 2:
        return values[..., None]
    if values.ndim == 3 and values.shape[0] <= MAX_CHANNELS:
        return np.moveaxis(values, 0, -1)
    if values.ndim == 3 and values.shape[2] <= MAX_CHANNELS:
        return values
    raise _no_map(network, result, name, "a map has a height, a width and few channels")


def _no_map(network: Network, result: np.ndarray, name: str, why: str) -> InputError:
    return InputError(f"{network.path} gives {name} as {tuple(result.shape)}, no {network.kind} map: {why}")
