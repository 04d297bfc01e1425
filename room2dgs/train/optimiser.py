"""Adam with one group a parameter, and its state as named tensors."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.optim import Adam

EPSILON = 1e-15  # 2DGS: gradients of a mean over pixels are tiny


def make_adam(parameters: dict[str, Tensor]) -> Adam:
    """Adam whose groups carry the parameters' names; rates are 0 until `set_rates`."""
    groups = [{"params": [value], "name": name} for name, value in parameters.items()]
    return Adam(groups, lr=0.0, eps=EPSILON, fused=True)


def set_rates(adam: Adam, rates: dict[str, float]) -> None:
    """Learning rate of each group by name."""
    for group in adam.param_groups:
        group["lr"] = rates[group["name"]]


def adam_state(adam: Adam) -> dict[str, Tensor]:
    """Moments and step counts: "exp_avg/offsets", ...; a parameter that never had a gradient has none."""
    return {
        f"{key}/{group['name']}": value
        for group in adam.param_groups
        for key, value in adam.state.get(group["params"][0], {}).items()
    }


def load_adam_state(adam: Adam, tensors: dict[str, Tensor]) -> None:
    """The way back from `adam_state`."""
    for group in adam.param_groups:
        state = {
            key: tensors[f"{key}/{group['name']}"].clone()
            for key in ("step", "exp_avg", "exp_avg_sq")
            if f"{key}/{group['name']}" in tensors
        }
        if state:
            adam.state[group["params"][0]] = state


def bad_gradients(parameters: dict[str, Tensor]) -> list[str]:
    """Names of the parameters whose gradient is not finite; cheap when all are."""
    with torch.no_grad():
        named = [(name, p.grad) for name, p in parameters.items() if p.grad is not None]
        if not named or torch.isfinite(torch.stack([grad.sum() for _, grad in named])).all():
            return []
        # a sum of large finite numbers can overflow: look again, one by one
        return [name for name, grad in named if not torch.isfinite(grad).all()]
