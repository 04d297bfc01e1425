"""Stopping when a number is no longer one, and saying which."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from room2dgs.train.objective import Term
from room2dgs.train.optimiser import bad_gradients


def check_loss(values: dict[str, float], iteration: int) -> None:
    """Stop on a loss term that is not finite.

    Raises:
        RuntimeError: names the iteration and the terms.
    """
    bad = [f"{name} = {value}" for name, value in values.items() if not math.isfinite(value)]
    if bad:
        raise RuntimeError(f"iteration {iteration}: loss {', '.join(bad)} is not finite; this is a fault of room2dgs")


def check_gradients(parameters: dict[str, Tensor], iteration: int, terms_again: Callable[[], dict[str, Term]]) -> None:
    """Stop on a gradient that is not finite.

    Args:
        terms_again: computes the iteration's loss terms anew, to find the one at fault.

    Raises:
        RuntimeError: names the iteration, the parameters and the loss terms that cause it.
    """
    bad = bad_gradients(parameters)
    if bad:
        causes = _causes([parameters[name] for name in bad], terms_again())
        raise RuntimeError(
            f"iteration {iteration}: the gradient of {', '.join(bad)} is not finite, "
            f"from {', '.join(causes) or 'the sum of all terms'}; this is a fault of room2dgs"
        )


def _causes(parameters: list[Tensor], terms: dict[str, Term]) -> list[str]:
    causes = []
    for name, term in terms.items():
        gradients = torch.autograd.grad(term.value, parameters, retain_graph=True, allow_unused=True)
        if any(g is not None and not torch.isfinite(g).all() for g in gradients):
            causes.append(name)
    return causes
