"""A loss whose gradients were worked out with its value."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor


def with_gradients(
    value: Tensor,
    inputs: Sequence[Tensor],
    gradients: Sequence[Tensor],
    *,
    share: Tensor | None = None,
    again: bool = False,
) -> Tensor:
    """`value` as autograd sees it: its derivative by each of `inputs` is the one of `gradients` in the same place.

    Args:
        value: scalar without a graph.
        inputs: what it was computed from, of any shapes.
        gradients: d value / d input, shaped as it, without a graph; given away: the backward pass writes to them.
        share: scalar that all gradients are still to be multiplied by.
        again: the backward pass may come more than once, as `gradcheck` has it; takes a copy of the gradients.

    Returns:
        scalar, differentiable once.
    """
    return _Known.apply(value, again, len(inputs), share, *inputs, *gradients)


class _Known(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx, value: Tensor, again: bool, count: int, share: Tensor | None, *inputs_and_gradients: Tensor
    ) -> Tensor:
        ctx.again, ctx.share = again, share
        ctx.save_for_backward(*inputs_and_gradients[count:])
        return value.view_as(value)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad: Tensor):
        # in place unless it may come again: torch refuses a second backward through this node
        grad = grad if ctx.share is None else grad * ctx.share
        times = torch.Tensor.mul if ctx.again else torch.Tensor.mul_
        gradients = [times(gradient, grad.to(gradient.device)) for gradient in ctx.saved_tensors]
        return None, None, None, None, *gradients, *[None] * len(gradients)
