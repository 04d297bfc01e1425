"""What training lessens: errors of depth and normals, and of how well their sizes are foretold."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.tools.prior_network.angular import angle_between, negative_log_likelihood
from room2dgs.tools.prior_network.network import Maps

# likelihoods are weighted by (expected error)^BETA: with 0 the network would learn what it knows already (Seitzer 2022)
BETA = 0.5
NORMAL_LIKELIHOOD, NORMAL_ANGLE = 1.0, 1.5
DEPTH_LIKELIHOOD, DEPTH_METRIC, DEPTH_GRADIENT, DEPTH_DISTANCE = 2.0, 0.6, 3.0, 0.6
GRADIENT_STRIDES = (1, 2, 4, 8)


class Truth(NamedTuple):
    """What the maps should have been.

    Attributes:
        depth: (B, 1, h, w) metres, 0 = invalid.
        normal: (B, 3, h, w) unit, 0 = invalid.
        distance: (B, 1, h, w) metres from the camera to the plane that touches the surface, 0 = invalid.
    """

    depth: Tensor
    normal: Tensor
    distance: Tensor


def losses(maps: Maps, truth: Truth) -> dict[str, Tensor]:
    """The terms by name, weighted, and their sum as "loss"; pixels without truth have no part."""
    terms = {**normal_terms(maps, truth), **depth_terms(maps, truth)}
    return {"loss": torch.stack(list(terms.values())).sum(), **terms}


def normal_terms(maps: Maps, truth: Truth) -> dict[str, Tensor]:
    """Likelihood of the angle and the angle itself."""
    valid = (truth.normal.square().sum(dim=1, keepdim=True) > 0.5).to(maps.normal.dtype)
    angle = angle_between(maps.normal, truth.normal) * valid
    kappa = maps.ln_kappa.exp()
    likelihood = negative_log_likelihood(angle, kappa) * kappa.detach() ** -BETA
    return {
        "normal_likelihood": NORMAL_LIKELIHOOD * masked_mean(likelihood, valid),
        "normal_angle": NORMAL_ANGLE * masked_mean(angle, valid),
    }


def depth_terms(maps: Maps, truth: Truth) -> dict[str, Tensor]:
    """Likelihood without the photo's scale, the scale, differences between neighbours, and the planes' distances."""
    valid = truth.depth > 0
    weight = valid.to(maps.ln_depth.dtype)
    error = (maps.ln_depth - torch.where(valid, truth.depth, 1.0).log()) * weight
    scale = maps.ln_scale.exp()
    offset = median_offset(error.detach(), valid)
    aligned = (error - offset).abs()
    likelihood = (aligned / scale + maps.ln_scale) * scale.detach() ** BETA
    return {
        "depth_likelihood": DEPTH_LIKELIHOOD * masked_mean(likelihood, weight),
        "depth_metric": DEPTH_METRIC * masked_mean(error.abs(), weight),
        "depth_gradient": DEPTH_GRADIENT * gradient_term(error, weight),
        "depth_distance": DEPTH_DISTANCE * distance_term(maps.ln_distance - offset, truth.distance),
    }


def distance_term(ln_distance: Tensor, distance: Tensor) -> Tensor:
    """Mean |error of ln distance|."""
    valid = distance > 0
    error = ln_distance - torch.where(valid, distance, 1.0).log()
    return masked_mean(error.abs(), valid.to(ln_distance.dtype))


def median_offset(error: Tensor, valid: Tensor) -> Tensor:
    """(B, 1, 1, 1) each photo's median over its valid pixels; 0 for a photo without any."""
    flat = torch.where(valid, error, torch.nan).flatten(1)
    return torch.nan_to_num(flat.nanmedian(dim=1).values, nan=0.0)[:, None, None, None]


def gradient_term(error: Tensor, weight: Tensor) -> Tensor:
    """Mean |difference of the error between neighbours| at several strides (Li & Snavely 2018)."""
    total = error.new_zeros(())
    for stride in GRADIENT_STRIDES:
        coarse, known = error[..., ::stride, ::stride], weight[..., ::stride, ::stride]
        across, down = known[..., 1:] * known[..., :-1], known[..., 1:, :] * known[..., :-1, :]
        total = total + masked_mean((coarse[..., 1:] - coarse[..., :-1]).abs(), across)
        total = total + masked_mean((coarse[..., 1:, :] - coarse[..., :-1, :]).abs(), down)
    return total / len(GRADIENT_STRIDES)


def masked_mean(values: Tensor, weight: Tensor) -> Tensor:
    """Mean over what counts; 0 when nothing does."""
    return (values * weight).sum() / weight.sum().clamp(min=1.0)
