"""Adding, removing and splitting seeds, with all that belongs to them: parameters and Adam's moments."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.config import SeedsConfig
from room2dgs.seeds.decoders.registry import restored_decoder
from room2dgs.train.model import Model, adam_state, load_adam_state, make_adam


def edit_seeds(model: Model, config: SeedsConfig, keep: Tensor, rows: dict[str, Tensor] | None = None) -> None:
    """Keep some seeds, in their order, and add new ones behind them, in place.

    Survivors keep their values and Adam's moments bit by bit; the moments of new seeds are zero. The count of steps,
    and what belongs to all seeds together, stay. Every parameter is a new leaf.

    Args:
        keep: (K,) int64, rising: the survivors' rows.
        rows: of new seeds, as `Decoder.rows_of` gives them; None: there are none.
    """
    rows = rows or {}
    per_seed = set(model.decoder.per_seed)
    keep = keep.to(model.decoder.fixed()["positions"].device)

    def moved(value: Tensor, new: Tensor | None) -> Tensor:
        old = value.detach()[keep]
        return old if new is None else torch.cat([old, new.to(old)])

    fixed = {name: moved(value, rows.get(name)) for name, value in model.decoder.fixed().items()}
    parameters = {
        name: moved(value, rows.get(name)) if name in per_seed else value.detach()
        for name, value in model.decoder.parameters().items()
    }
    state = {}
    for key, value in adam_state(model.adam).items():
        moment, _, name = key.partition("/")
        of_seeds = moment != "step" and name in per_seed
        state[key] = moved(value, torch.zeros_like(rows[name]) if name in rows else None) if of_seeds else value

    _replace(model, config, fixed, parameters, state)


def single_surfels(model: Model, config: SeedsConfig) -> bool:
    """Each surfel becomes a seed of its own, in place and in their order, so that it can go alone.

    Returns:
        False, and nothing has changed, where surfels share their seed's features.
    """
    per_seed, count = set(model.decoder.per_seed), model.surfel_count // max(model.seeds, 1)
    parameters = model.decoder.parameters()
    if "features" in per_seed:
        return False

    def apart(value: Tensor) -> Tensor:
        return value.detach().flatten(0, 1)[:, None]

    state = {}
    for key, value in adam_state(model.adam).items():
        moment, _, name = key.partition("/")
        state[key] = apart(value) if moment != "step" and name in per_seed else value
    fixed = {name: value.repeat_interleave(count, dim=0) for name, value in model.decoder.fixed().items()}
    _replace(model, config, fixed, {name: apart(value) for name, value in parameters.items()}, state)
    return True


def _replace(
    model: Model,
    config: SeedsConfig,
    fixed: dict[str, Tensor],
    parameters: dict[str, Tensor],
    state: dict[str, Tensor],
) -> None:
    model.decoder = restored_decoder(config, fixed, parameters)
    model.adam = make_adam(model.decoder.parameters())
    load_adam_state(model.adam, state)
