"""Whether a checkpoint's tensors are those of the decoder that the settings make: the file may be a stranger's."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.primitives.registry import new_primitive
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.decoder import Decoder
from room2dgs.seeds.decoders.registry import new_decoder
from room2dgs.train.checkpoint import Checkpoint

MOMENTS = ("exp_avg", "exp_avg_sq")
STEP = "step"


def check_state(state: Checkpoint, config: Config) -> None:
    """Refuse what the decoder and its optimiser cannot hold.

    Raises:
        InputError: names the first tensor that is missing, too many, of another kind or shape, or not finite.
    """
    pattern = _one_seed(config, state)
    positions = state.fixed.get("positions")
    seeds = len(positions) if positions is not None and positions.dim() else 0
    wrong = next(_wrong(state, pattern, seeds), None) if seeds else "holds no seeds"
    if wrong:
        raise InputError(f"the checkpoint of iteration {state.iteration} {wrong}; delete it and go on with another")


def _one_seed(config: Config, state: Checkpoint) -> Decoder:
    """A decoder of these settings: its tensors have the names, kinds and shapes of any number of seeds'."""
    offsets = state.parameters.get("offsets")
    # strategies separate a seed's primitives: each is then a seed of its own
    separate = offsets is not None and offsets.dim() == 3 and offsets.shape[1] == 1
    each = 1 if separate else config.seeds.per_seed
    rotations = torch.zeros(1, each, 4)
    rotations[..., 0] = 1
    ones, zeros = torch.ones(1, each), torch.zeros(1, each, 3)
    spawned = Spawned(zeros[:, 0], zeros, rotations, 0.1 * torch.ones(1, each, 2), 0.5 * ones, zeros)
    primitive, degree = new_primitive(config), config.render.sh_degree
    return new_decoder(spawned, primitive, config.seeds, degree, config.train.seed)


def _wrong(state: Checkpoint, pattern: Decoder, seeds: int) -> Iterator[str]:
    wanted = pattern.parameters()
    by_seed = {*pattern.per_seed, *pattern.fixed()}
    yield from _differing(state.fixed, pattern.fixed(), by_seed, seeds)
    yield from _differing(state.parameters, wanted, by_seed, seeds)
    for name, value in state.adam.items():
        moment, _, owner = name.partition("/")
        if owner not in wanted or moment not in (STEP, *MOMENTS):
            yield f"has {name}, which the settings do not make"
        elif moment in MOMENTS and value.shape != state.parameters[owner].shape:
            yield f"has {name} of shape {tuple(value.shape)}, not {tuple(state.parameters[owner].shape)}"
        elif moment == STEP and value.numel() != 1:
            yield f"has {name} of shape {tuple(value.shape)}, not one number"
    for name, value in state.adam.items():
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            yield f"has {name} that is not finite"


def _differing(found: dict[str, Tensor], wanted: dict[str, Tensor], by_seed: set[str], seeds: int) -> Iterator[str]:
    for name in sorted(found.keys() ^ wanted.keys()):
        yield f"lacks {name}" if name in wanted else f"has {name}, which the settings do not make"
    for name in sorted(found.keys() & wanted.keys()):
        value, like = found[name], wanted[name]
        shape = (seeds, *like.shape[1:]) if name in by_seed else tuple(like.shape)
        if tuple(value.shape) != shape or value.dtype != like.dtype:
            kind = str(value.dtype).removeprefix("torch.")
            yield f"has {name} as {kind} of shape {tuple(value.shape)}, not {shape}"
        elif not bool(torch.isfinite(value).all()):
            yield f"has {name} that is not finite"
