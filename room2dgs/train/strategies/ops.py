"""What strategies do to a model's named parameters, row by row, with all that belongs to them: Adam's moments, too."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.train.model import Model, adam_state, load_adam_state, make_adam

Tensors = dict[str, Tensor]


def copied_rows(model: Model, index: Tensor) -> Tensors:
    """Copies of some rows of all tensors that have one a seed, by name; detached.

    Args:
        index: (M,) int64.
    """
    own = model.decoder.fixed() | {name: model.decoder.parameters()[name] for name in model.decoder.per_seed}
    return {name: value.detach()[index] for name, value in own.items()}


def joined_rows(first: Tensors, second: Tensors) -> Tensors:
    """Both, in this order, by name."""
    return {name: torch.cat([value, second[name]]) for name, value in first.items()}


def edit_rows(model: Model, keep: Tensor, new: Tensors | None = None) -> None:
    """Keep some rows, in their order, and add new ones behind them, in place.

    Survivors keep their values and Adam's moments bit by bit; the moments of new rows are zero. The count of steps,
    and what belongs to all rows together, stay. Every parameter is a new leaf.

    Args:
        keep: (K,) int64, rising: the survivors.
        new: of each tensor that has one row a seed, by name (`copied_rows`, `Decoder.rows_of`); None: there are none.
    """
    new = new or {}
    per_seed = set(model.decoder.per_seed)
    keep = keep.to(_device(model))

    def edited(value: Tensor, added: Tensor | None) -> Tensor:
        kept = value.detach()[keep]
        return kept if added is None else torch.cat([kept, added.to(kept)])

    fixed = {name: edited(value, new.get(name)) for name, value in model.decoder.fixed().items()}
    parameters = {
        name: edited(value, new.get(name)) if name in per_seed else value.detach()
        for name, value in model.decoder.parameters().items()
    }
    state = {}
    for key, value in adam_state(model.adam).items():
        name = _moment_of(key)
        added = torch.zeros_like(new[name]) if name in new else None
        state[key] = edited(value, added) if name in per_seed else value
    _replace(model, fixed, parameters, state)


def separate_rows(model: Model) -> bool:
    """Each primitive becomes a row of its own, in place and in their order, so that it can go alone.

    Returns:
        False, and nothing has changed, where the primitives of a row share parameters.
    """
    if not model.decoder.separable:
        return False
    per_seed, each = set(model.decoder.per_seed), model.count // max(model.seeds, 1)

    def separate(value: Tensor) -> Tensor:
        return value.detach().flatten(0, 1)[:, None]

    state = {
        key: separate(value) if _moment_of(key) in per_seed else value for key, value in adam_state(model.adam).items()
    }
    fixed = {name: value.repeat_interleave(each, dim=0) for name, value in model.decoder.fixed().items()}
    _replace(model, fixed, {name: separate(value) for name, value in model.decoder.parameters().items()}, state)
    return True


def cap_parameter(model: Model, name: str, highest: float) -> None:
    """No number of a parameter above the highest, in place, and no momentum that could bring it back at once."""
    values = model.decoder.parameters()[name]
    with torch.no_grad():
        values.clamp_(max=highest)
    for moment in ("exp_avg", "exp_avg_sq"):
        if moment in model.adam.state[values]:
            model.adam.state[values][moment].zero_()


def _moment_of(key: str) -> str:
    """The parameter whose moment stands under a key of `adam_state`; "" for a count of steps."""
    moment, _, name = key.partition("/")
    return "" if moment == "step" else name


def _device(model: Model) -> torch.device:
    return next(iter(model.decoder.fixed().values())).device


def _replace(model: Model, fixed: Tensors, parameters: Tensors, state: Tensors) -> None:
    model.decoder = model.decoder.with_tensors(fixed, parameters)
    model.adam = make_adam(model.decoder.parameters())
    load_adam_state(model.adam, state)
