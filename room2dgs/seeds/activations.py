"""Raw parameters to metres and probabilities, and back; the one place that knows how.

Bounds are kept by projection after each step (`Decoder.constrain`), not by a clamp in the forward
pass: a clamped value would have no gradient to come back by.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

SCALE_MIN_M, SCALE_MAX_M = 1e-5, 10.0  # thinner than any pixel's footprint; wider than any wall piece
LOG_SCALE_MIN, LOG_SCALE_MAX = math.log(SCALE_MIN_M), math.log(SCALE_MAX_M)
OPACITY_LOGIT_MAX = 12.0  # sigmoid(12) = 1 - 6e-6: still below 1 in float32, with a gradient left


def scale_of(log_scale: Tensor) -> Tensor:
    """Metres."""
    return torch.exp(log_scale)


def log_scale_of(scale: Tensor) -> Tensor:
    """Inverse of `scale_of`, inside the bounds."""
    return torch.log(scale).clamp(LOG_SCALE_MIN, LOG_SCALE_MAX)


def opacity_of(logit: Tensor) -> Tensor:
    """In (0, 1)."""
    return torch.sigmoid(logit)


def opacity_logit_of(opacity: Tensor) -> Tensor:
    """Inverse of `opacity_of`, inside the bounds."""
    return torch.logit(opacity).clamp(-OPACITY_LOGIT_MAX, OPACITY_LOGIT_MAX)
