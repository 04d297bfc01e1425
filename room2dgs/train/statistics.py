"""Means of what is logged, between two log lines."""

from __future__ import annotations

import math

import torch
from torch import Tensor


class Means:
    """Running means by name since the last `take`; a name may come in some iterations only."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._counts: dict[str, int] = {}

    def add(self, values: dict[str, float]) -> None:
        for name, value in values.items():
            self._sums[name] = self._sums.get(name, 0.0) + value
            self._counts[name] = self._counts.get(name, 0) + 1

    def take(self) -> dict[str, float]:
        """The means, and start anew."""
        means = {name: total / self._counts[name] for name, total in self._sums.items()}
        self._sums, self._counts = {}, {}
        return means


def psnr_db(image: Tensor, target: Tensor) -> float:
    """Peak signal-to-noise ratio of an image clamped to 0..1, decibels."""
    with torch.no_grad():
        error = torch.nn.functional.mse_loss(image.detach().clamp(0.0, 1.0), target).item()
    return -10.0 * math.log10(max(error, 1e-12)) if math.isfinite(error) else math.nan
