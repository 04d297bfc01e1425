"""What a correction is trained for: pixels that are right to centimetres, slopes, and errors that it knows of."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.tools.correction_network.network import Correction

NEAR_M, NEARER_M = 0.05, 0.02  # distances at which a pixel counts as half wrong
FARTHEST, STEEPEST = 0.5, 0.05  # of ln depth, and of its difference between neighbours, beyond which nothing pulls
WEIGHTS = {"near": 1.0, "nearer": 0.5, "depth": 3.0, "slope": 3.0, "likelihood": 0.05}


class Target(NamedTuple):
    """What is true.

    Attributes:
        shift: (B, h, w) ln of true over completed depth; NaN where nobody knows.
        depth: (B, h, w) completed depth, metres.
    """

    shift: Tensor
    depth: Tensor


def losses(found: Correction, target: Target) -> dict[str, Tensor]:
    """Each term's mean over the pixels that are known; `WEIGHTS` says what they weigh.

    The terms that count pixels as wrong are Geman and McClure's: a wrong pixel that cannot be mended does not pull the
    others.
    """
    known = torch.isfinite(target.shift)
    count = known.sum().clamp(min=1)
    off = (found.shift - torch.where(known, target.shift, 0.0)) * known
    size = off.abs()
    metres = size * target.depth
    slope = sum(_slopes(off, known, axis) for axis in (1, 2))
    likelihood = size.detach() / found.ln_scale.exp() + found.ln_scale
    return {
        "near": _wrong(metres, NEAR_M).sum() / count,
        "nearer": _wrong(metres, NEARER_M).sum() / count,
        "depth": size.clamp(max=FARTHEST).sum() / count,
        "slope": slope / count,
        "likelihood": (likelihood * known).sum() / count,
    }


def _wrong(metres: Tensor, width: float) -> Tensor:
    return metres**2 / (metres**2 + width**2)


def _slopes(off: Tensor, known: Tensor, axis: int) -> Tensor:
    both = known.narrow(axis, 1, known.shape[axis] - 1) & known.narrow(axis, 0, known.shape[axis] - 1)
    return (torch.diff(off, dim=axis).abs().clamp(max=STEEPEST) * both).sum()
