"""The decoders by the name that the settings give, new or from their tensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor

from room2dgs.config import SeedsConfig
from room2dgs.primitives.activations import scale_activation
from room2dgs.seeds.decoders.decoder import Decoder
from room2dgs.seeds.decoders.explicit import ExplicitDecoder, explicit_decoder
from room2dgs.seeds.decoders.shared import SharedDecoder, shared_decoder
from room2dgs.seeds.spawn import Spawned


class DecoderKind(NamedTuple):
    """How a decoder is made.

    Attributes:
        new: from spawned surfels, settings, SH degree and random seed; the surfels are its first ones.
        restored: from the tensors of `fixed()` and `parameters()` by name, which it keeps, and `activation`.
    """

    new: Callable[[Spawned, SeedsConfig, int, int], Decoder]
    restored: Callable[..., Decoder]


DECODERS: dict[str, DecoderKind] = {
    "explicit": DecoderKind(
        lambda spawned, config, sh_degree, seed: explicit_decoder(spawned, sh_degree, scale_activation(config)),
        ExplicitDecoder,
    ),
    "shared": DecoderKind(
        lambda spawned, config, sh_degree, seed: shared_decoder(
            spawned, config.feature_size, seed, scale_activation(config)
        ),
        SharedDecoder,
    ),
}


def new_decoder(spawned: Spawned, config: SeedsConfig, sh_degree: int, seed: int) -> Decoder:
    """A decoder whose first surfels are the spawned ones.

    Args:
        spawned: k surfels for each of S seeds.
        config: names the decoder and its settings.
        sh_degree: 0..3; 0 for the shared decoder.
        seed: the same number gives the same bits.
    """
    return DECODERS[config.decoder].new(spawned, config, sh_degree, seed)


def restored_decoder(config: SeedsConfig, fixed: dict[str, Tensor], parameters: dict[str, Tensor]) -> Decoder:
    """The decoder that had these `fixed()` and `parameters()`; it keeps the tensors, which become leaves.

    Args:
        config: the settings that the decoder was made with.
    """
    leaves = {name: value.detach() for name, value in parameters.items()}
    return DECODERS[config.decoder].restored(**fixed, **leaves, activation=scale_activation(config))
