"""Stopping at a loss or gradient that is not finite, with the name of the term that causes it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from room2dgs.kernels.builds import is_asynchronous
from room2dgs.train.objective import Term
from room2dgs.train.trainer import Hook, Iteration, Trainer

EVERY = 100  # iterations after which a GPU is asked what it has noted


class FiniteCheck(Hook):
    """Ends the run before a step with numbers that are not finite; the model stays as it was.

    A GPU notes them, and is asked now and then, and before each checkpoint: then the model is lost since the last one.

    Raises:
        RuntimeError: in `after_backward`; names the iteration, the view, the parameters and the loss terms.
    """

    def __init__(self) -> None:
        self._bad: Tensor | None = None

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        check_now = iteration.done % EVERY == 0 or iteration.done % trainer.config.train.checkpoint_every == 0
        if self._bad is not None and (check_now or trainer.finished) and bool(self._bad.isnan()):
            raise RuntimeError(
                f"up to iteration {iteration.number}: a loss or gradient was not finite; this is a fault of room2dgs, "
                "and resume=true goes on from the last checkpoint"
            )

    def after_backward(self, trainer: Trainer, iteration: Iteration) -> None:
        loss = iteration.step.losses["loss"]
        if isinstance(loss, Tensor) and is_asynchronous(loss):
            # a largest number that is not finite is NaN once it is multiplied by 0, and stays so
            found = torch.stack([torch.linalg.vector_norm(x, math.inf) for x in (loss, *_gradients(trainer))])
            found = 0 * found.sum()
            self._bad = found if self._bad is None else self._bad + found
            return
        where = f"iteration {iteration.number}, view {iteration.view.name}"
        check_loss(iteration.step.losses, where)
        check_gradients(trainer.model.decoder.parameters(), where, iteration.step.terms_again)


def _gradients(trainer: Trainer) -> list[Tensor]:
    return [p.grad for p in trainer.model.decoder.parameters().values() if p.grad is not None]


def check_loss(values: Mapping[str, float | Tensor], where: str) -> None:
    """Stop on a loss term that is not finite.

    Raises:
        RuntimeError: names the iteration and the terms.
    """
    bad = [f"{name} = {value}" for name, value in values.items() if not math.isfinite(value)]
    if bad:
        raise RuntimeError(f"{where}: loss {', '.join(bad)} is not finite; this is a fault of room2dgs")


def check_gradients(parameters: dict[str, Tensor], where: str, terms_again: Callable[[], dict[str, Term]]) -> None:
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
            f"{where}: the gradient of {', '.join(bad)} is not finite, "
            f"from {', '.join(causes) or 'the sum of all terms'}; this is a fault of room2dgs"
        )


def bad_gradients(parameters: dict[str, Tensor]) -> list[str]:
    """Names of the parameters whose gradient is not finite; cheap when all are."""
    with torch.no_grad():
        named = [(name, p.grad) for name, p in parameters.items() if p.grad is not None]
        if not named or torch.isfinite(torch.stack([grad.sum() for _, grad in named])).all():
            return []
        # a sum of large finite numbers can overflow: each is checked by itself
        return [name for name, grad in named if not torch.isfinite(grad).all()]


def _causes(parameters: list[Tensor], terms: dict[str, Term]) -> list[str]:
    causes = []
    for name, term in terms.items():
        gradients = torch.autograd.grad(term.value, parameters, retain_graph=True, allow_unused=True)
        if any(g is not None and not torch.isfinite(g).all() for g in gradients):
            causes.append(name)
    return causes
