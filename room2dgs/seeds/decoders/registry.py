"""Decoders by the name that the settings give, new or from their tensors."""

from __future__ import annotations

from torch import Tensor

from room2dgs.config import SeedsConfig
from room2dgs.primitives.primitive import Primitive
from room2dgs.primitives.spawned import Spawned
from room2dgs.registries.decoders import DECODERS
from room2dgs.seeds.decoders.decoder import Decoder


def new_decoder(spawned: Spawned, primitive: Primitive, config: SeedsConfig, sh_degree: int, seed: int) -> Decoder:
    """A decoder whose first primitives are the spawned discs.

    Args:
        spawned: k discs for each of S seeds.
        primitive: what they become.
        config: names the decoder and its settings.
        sh_degree: 0..3; 0 for the shared decoder.
        seed: the same number gives the same bits.
    """
    return DECODERS.load(config.decoder).new(spawned, primitive, config, sh_degree, seed)


def restored_decoder(
    primitive: Primitive, config: SeedsConfig, fixed: dict[str, Tensor], parameters: dict[str, Tensor]
) -> Decoder:
    """The decoder that had these `fixed()` and `parameters()`; it keeps the tensors, which become leaves.

    Args:
        primitive, config: those that the decoder was made with.
    """
    leaves = {name: value.detach() for name, value in parameters.items()}
    return DECODERS.load(config.decoder).restored(primitive, fixed, leaves)
