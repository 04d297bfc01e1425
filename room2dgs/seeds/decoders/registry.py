"""The decoder that the settings name, new or from its tensors."""

from __future__ import annotations

from torch import Tensor

from room2dgs.config import SeedsConfig
from room2dgs.seeds.decoders.activations import ScaleActivation
from room2dgs.seeds.decoders.decoder import Decoder
from room2dgs.seeds.decoders.explicit import ExplicitDecoder, explicit_decoder
from room2dgs.seeds.decoders.shared import SharedDecoder, shared_decoder
from room2dgs.seeds.spawn import Spawned


def new_decoder(spawned: Spawned, config: SeedsConfig, sh_degree: int, seed: int) -> Decoder:
    """A decoder whose first surfels are the spawned ones.

    Args:
        spawned: k surfels for each of S seeds.
        config: names the decoder and its settings.
        sh_degree: 0..3; 0 for the shared decoder.
        seed: the same number gives the same bits.
    """
    activation = scale_activation(config)
    if config.decoder == "shared":
        return shared_decoder(spawned, config.feature_size, seed, activation)
    return explicit_decoder(spawned, sh_degree, activation)


def restored_decoder(config: SeedsConfig, fixed: dict[str, Tensor], parameters: dict[str, Tensor]) -> Decoder:
    """The decoder that had these `fixed()` and `parameters()`; it keeps the tensors, which become leaves.

    Args:
        config: the settings that the decoder was made with.
    """
    leaves = {name: value.detach() for name, value in parameters.items()}
    made = SharedDecoder if config.decoder == "shared" else ExplicitDecoder
    return made(**fixed, **leaves, activation=scale_activation(config))


def scale_activation(config: SeedsConfig) -> ScaleActivation:
    """What a raw scale means under these settings."""
    if config.scale_activation == "exp":
        return ScaleActivation("exp")
    # up to the largest first scale both activations take steps of like size
    return ScaleActivation(config.scale_activation, config.max_scale_m)
