"""The angular distribution of normals: density ~ exp(-kappa * angle) on the sphere (Bae et al. 2021)."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def angle_between(first: Tensor, second: Tensor) -> Tensor:
    """(B, 3, ...) unit vectors -> (B, 1, ...) radians; the gradient stays finite at 0 and at pi."""
    squared = (first - second).square().sum(dim=1, keepdim=True)
    # half the chord; its arcsine is exact at small angles, where the arccosine of the product is not
    return 2.0 * torch.asin((0.5 * torch.sqrt(squared + 1e-6)).clamp(max=0.9999))


def negative_log_likelihood(angle: Tensor, kappa: Tensor) -> Tensor:
    """-ln of the density, without the constant ln(2 pi) (Bae et al. 2021, eq. 4)."""
    return kappa * angle - torch.log1p(kappa.square()) + torch.log1p(torch.exp(-math.pi * kappa))


def expected_angle(kappa: Tensor) -> Tensor:
    """Mean angle in radians under the density: 2 k / (k^2 + 1) + pi e^(-pi k) / (1 + e^(-pi k))."""
    tail = torch.exp(-math.pi * kappa)
    return 2.0 * kappa / (kappa.square() + 1.0) + math.pi * tail / (1.0 + tail)
