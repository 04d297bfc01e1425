"""Rendered normals against predicted ones."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.block_code import build_for
from room2dgs.geometry.arguments import number
from room2dgs.geometry.kernel_arguments import plain_map, runs_compiled
from room2dgs.kernel_calls import call
from room2dgs.losses import blocks
from room2dgs.losses.checks import check_images, check_mask, check_step
from room2dgs.losses.known_gradients import with_gradients

MIN_ALPHA = 0.5  # pixels less covered have no normal worth comparing
TINY = 1e-3  # normals that cancel along the ray have no direction; their gradient stays below 1 / TINY


def reweighting(normal: Tensor, prior: Tensor, width_deg: float) -> Tensor:
    """Weight of each prior normal by its angle to the rendered one: 1 where they agree, a quarter at `width_deg`.

    (1 + (1 - n . n_p) / (1 - cos width))^-2, the weight of Geman and McClure's robust cost. Where views tell the
    surface, the rendered normal keeps its angle to a wrong prior; where nothing else tells it, it follows the prior.

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
    Means are over the number of pixels that are `valid` and have alpha >= 0.5; without one the loss is 0. float32 on
    the CPU takes the compiled kernel, the same bits on any number of threads.

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
    compared = tuple(-(-pixels // step) for pixels in alpha.shape)
    of_prior = (valid,) if confidence is None else (valid, confidence)
    sizes = [prior.shape[:2], *(other.shape for other in of_prior)]
    if normal.shape != (*alpha.shape, 3) or prior.shape[2:] != (3,) or any(size != compared for size in sizes):
        raise ValueError("normal, alpha, prior, valid and confidence differ in size")
    if build_for(normal, alpha, prior):
        return blocks.normal_prior_loss(
            normal, alpha, prior, valid, l1=l1, cosine=cosine, confidence=confidence, step=step
        )
    if runs_compiled(normal, alpha, prior):
        maps = map(plain_map, (normal, alpha, prior, valid, confidence))
        gradient = torch.empty(normal.shape, dtype=torch.float32)
        value = call(_C.normal_prior, *maps, l1, cosine, step, gradient)
        return with_gradients(normal.new_tensor(value), [normal], [gradient])
    normal, alpha = normal[::step, ::step], alpha[::step, ::step]
    compared = valid & (alpha.detach() >= MIN_ALPHA)
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
