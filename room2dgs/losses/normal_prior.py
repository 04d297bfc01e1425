"""Rendered normals against predicted ones."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.geometry.arguments import number
from room2dgs.kernels.builds import Build
from room2dgs.kernels.calls import call
from room2dgs.kernels.operators import has_kernels, operator
from room2dgs.losses.block_losses import empty_like, empty_sums, losses_of, plain, plain_or_none
from room2dgs.losses.checks import check_images, check_mask, check_sizes, check_step
from room2dgs.losses.known_gradients import with_gradients
from room2dgs.splat.constants import MIN_COVERED_ALPHA

TINY = 1e-3  # normals that cancel along the ray have no direction; their gradient stays below 1 / TINY


def reweighting(normal: Tensor, prior: Tensor, width_deg: float) -> Tensor:
    """Weight of each prior normal by its angle to the rendered one: 1 where they agree, a quarter at `width_deg`.

    (1 + (1 - n . n_p) / (1 - cos width))^-2, the weight of Geman and McClure's robust cost. Where the photos
    determine the surface, the rendered normal keeps its angle to a wrong prior; elsewhere it follows the prior.

    Args:
        normal: (H, W, 3) rendered, alpha-weighted, not normalised; no gradient.
        prior: (H, W, 3) unit, or 0.

    Returns:
        (H, W), in 0..1.

    Raises:
        TypeError, ValueError: maps that are no tensors in floating point, empty or of different sizes; no such angle.
    """
    check_images(3, normal=normal, prior=prior)
    if normal.shape != prior.shape:
        raise ValueError("normal and prior differ in size")
    if not 0 < number("width_deg", width_deg) <= 180:
        raise ValueError(f"width_deg is {width_deg}; it is to be above 0 and at most 180")
    rendered, wanted = normal.detach().permute(2, 0, 1).contiguous(), prior.permute(2, 0, 1).contiguous()
    cosine = (rendered * wanted).sum(0) * torch.rsqrt(rendered.square().sum(0) + TINY**2)
    return (1 + (1 - cosine).clamp(min=0) / (1 - math.cos(math.radians(width_deg)))).pow(-2)


def normal_prior_loss(
    normal: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    *,
    l1: float = 0.01,
    cosine: float = 0.01,
    confidence: Tensor | None = None,
    step: int = 1,
) -> Tensor:
    """L_n = l1 * mean w |n - n_p|_1 + cosine * mean w (1 - n . n_p) (eq. 11-12; l1, cosine from the supplement).

    n is the rendered normal made unit, n_p the prior; |.|_1 sums the three axes; w is the prior's confidence.
    Means are over the number of pixels that are `valid` and have alpha >= 0.5; without one the loss is 0. float32
    takes compiled kernels, the same bits on any number of threads.

    Args:
        normal: (H, W, 3) rendered, alpha-weighted, world frame, facing the camera; not normalised.
        alpha: (H, W) rendered coverage; no gradient.
        prior: (H, W, 3) unit, world frame, facing the camera; no gradient.
        valid: (H, W) bool.
        confidence: (H, W) w in 0..1, no gradient; None: 1 everywhere.
        step: prior, valid and confidence have every step-th row and column of normal and alpha, from the first.

    Returns:
        scalar, differentiable once with respect to `normal`.

    Raises:
        TypeError: a map is no tensor of the type it should have.
        ValueError: maps that are empty or of different sizes; numbers that cannot be.
    """
    check_images(3, normal=normal, prior=prior)
    check_images(**{"alpha": alpha} if confidence is None else {"alpha": alpha, "confidence": confidence})
    check_mask("valid", valid)
    step = check_step(step)
    number("l1", l1)
    number("cosine", cosine)
    check_sizes({"normal": normal, "alpha": alpha}, {"prior": prior, "valid": valid, "confidence": confidence}, step)
    if has_kernels(normal, alpha, prior):
        value, gradient, share = NORMAL_PRIOR(normal, alpha, prior, valid, confidence, l1, cosine, step)
        return with_gradients(value, [normal], [gradient], share=share)
    normal, alpha = normal[::step, ::step], alpha[::step, ::step]
    compared = valid & (alpha.detach() >= MIN_COVERED_ALPHA)
    share = compared.to(normal.dtype) / torch.count_nonzero(compared).clamp(min=1)
    if confidence is not None:
        share = share * torch.where(compared, confidence, 0.0)
    # Axis by axis: torch sums over an innermost axis of three very slowly.
    rendered = torch.where(compared, normal.permute(2, 0, 1).contiguous(), 0.0)
    wanted = torch.where(compared, prior.permute(2, 0, 1).contiguous(), 0.0)
    rendered = rendered * torch.rsqrt(rendered.square().sum(0) + TINY**2)
    distance = (rendered - wanted).abs().sum(0)
    apart = 1 - (rendered * wanted).sum(0)
    return ((l1 * distance + cosine * apart) * share).sum()


def _on_cpu(
    normal: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    confidence: Tensor | None,
    l1: float,
    cosine: float,
    step: int,
) -> tuple[Tensor, Tensor, Tensor]:
    maps = (*map(plain, (normal, alpha, prior)), *map(plain_or_none, (valid, confidence)))
    gradient = empty_like(normal)
    value = call(_C.normal_prior, *maps, l1, cosine, step, gradient)
    return normal.new_tensor(value), gradient, normal.new_tensor(1.0)


def _by_block_code(
    build: Build,
    normal: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    confidence: Tensor | None,
    l1: float,
    cosine: float,
    step: int,
) -> tuple[Tensor, Tensor, Tensor]:
    """The number of pixels is known when the gradient is there already, which is therefore to be multiplied by it."""
    losses, queue = losses_of(build, normal)
    maps = (*map(plain, (normal, alpha, prior)), *map(plain_or_none, (valid, confidence)))
    gradient, values = empty_like(normal), empty_sums(normal, 2)
    call(losses.normal_prior, *maps, l1, cosine, step, gradient, values, queue)
    value, share = values.to(normal.dtype)
    return value, gradient, share


NORMAL_PRIOR = operator(
    "normal_prior(Tensor normal, Tensor alpha, Tensor prior, Tensor valid, Tensor? confidence, float l1, "
    "float cosine, int step) -> (Tensor, Tensor, Tensor)",
    _by_block_code,
    _on_cpu,
)
