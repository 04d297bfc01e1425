"""Raw parameters to metres and probabilities, and back; the one place that knows how.

Bounds are kept by projection after each step (`Primitive.constrain_`), not by a clamp in the forward
pass: a clamped value would have no gradient to come back by.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional

from room2dgs.config import SeedsConfig

SCALE_MIN_M, SCALE_MAX_M = 1e-5, 10.0  # thinner than any pixel's footprint; wider than any wall piece
OPACITY_LOGIT_MAX = 12.0  # sigmoid(12) = 1 - 6e-6: still below 1 in float32, with a gradient left
LINEAR_ABOVE = 40.0  # softplus(40) - 40 = 4e-18


@dataclass(frozen=True)
class ScaleActivation:
    """What a raw scale means: unit_m x exp(raw) or unit_m x softplus(raw), metres.

    An optimiser's step of d changes the scale by the factor exp(d) under exp, whatever the scale is.
    Under softplus it does so for scales well below the unit, and adds unit_m x d above it.
    """

    name: str = "exp"
    unit_m: float = 1.0

    def scale_of(self, raw: Tensor) -> Tensor:
        """Metres."""
        if self.name == "exp":
            return self.unit_m * torch.exp(raw)
        return self.unit_m * functional.softplus(raw, threshold=LINEAR_ABOVE)

    def raw_of(self, scale: Tensor) -> Tensor:
        """Inverse of `scale_of`, inside the bounds."""
        units = scale.clamp(SCALE_MIN_M, SCALE_MAX_M) / self.unit_m
        if self.name == "exp":
            return torch.log(units)
        return units + torch.log(-torch.expm1(-units))

    def constrain_(self, raw: Tensor, low_m: float = SCALE_MIN_M, high_m: float = SCALE_MAX_M) -> None:
        """Bring raw scales back to what means `low_m` to `high_m`, in place."""
        raw.clamp_(*_raw_bounds(self, low_m, high_m))


@lru_cache(maxsize=8)
def _raw_bounds(activation: ScaleActivation, low_m: float, high_m: float) -> tuple[float, float]:
    low, high = activation.raw_of(torch.tensor([low_m, high_m], dtype=torch.float64)).tolist()
    return low, high


EXP = ScaleActivation()


def scale_activation(config: SeedsConfig) -> ScaleActivation:
    """What a raw scale means under these settings."""
    if config.scale_activation == "exp":
        return EXP
    # up to the largest first scale both activations take steps of like size
    return ScaleActivation(config.scale_activation, config.max_scale_m)


def opacity_of(logit: Tensor) -> Tensor:
    """In (0, 1)."""
    return torch.sigmoid(logit)


def opacity_logit_of(opacity: Tensor) -> Tensor:
    """Inverse of `opacity_of`, inside the bounds."""
    return torch.logit(opacity).clamp(-OPACITY_LOGIT_MAX, OPACITY_LOGIT_MAX)
