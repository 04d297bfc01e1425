"""Rendered normals against predicted ones."""

from __future__ import annotations

import torch
from torch import Tensor

MIN_ALPHA = 0.5  # pixels less covered have no normal worth comparing
TINY = 1e-3  # normals that cancel along the ray have no direction; their gradient stays below 1 / TINY


def normal_prior_loss(
    normal: Tensor, alpha: Tensor, prior: Tensor, valid: Tensor, *, l1: float = 0.01, cosine: float = 0.01
) -> Tensor:
    """L_n = l1 * mean |n - n_p|_1 + cosine * mean (1 - n . n_p) (eq. 11-12; both weights from the supplement).

    n is the rendered normal made unit, n_p the prior; |.|_1 sums the three axes. Means are over the pixels that are
    `valid` and have alpha >= 0.5; without one the loss is 0.

    Args:
        normal: (H, W, 3) rendered, alpha-weighted, world frame, facing the camera; not normalised.
        alpha: (H, W) rendered coverage; no gradient.
        prior: (H, W, 3) unit, world frame, facing the camera; no gradient.
        valid: (H, W) bool.

    Returns:
        scalar, differentiable with respect to `normal`.

    Raises:
        ValueError: maps of different sizes.
    """
    if normal.shape != prior.shape or not alpha.shape == valid.shape == normal.shape[:2]:
        raise ValueError("normal, alpha, prior and valid differ in size")
    compared = valid & (alpha.detach() >= MIN_ALPHA)
    weight = compared.to(normal.dtype) / max(1, int(torch.count_nonzero(compared)))
    # Axis by axis: torch sums over an innermost axis of three very slowly.
    rendered = torch.where(compared, normal.permute(2, 0, 1).contiguous(), 0.0)
    wanted = torch.where(compared, prior.permute(2, 0, 1).contiguous(), 0.0)
    rendered = rendered * torch.rsqrt(rendered.square().sum(0) + TINY**2)
    distance = (rendered - wanted).abs().sum(0)
    apart = 1 - (rendered * wanted).sum(0)
    return ((l1 * distance + cosine * apart) * weight).sum()
