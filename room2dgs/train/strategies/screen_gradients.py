"""Sums of each surfel's screen-space gradients between two adjustments."""

from __future__ import annotations

from functools import lru_cache

import torch
from torch import Tensor

TINY = 1e-30  # a squared gradient that counts as none


class ScreenGradients:
    """Norms of the gradients of the projected centres, summed by surfel, and in how many iterations there were any.

    In 2DGS's units, so that its thresholds keep their meaning: a pixel gradient times half the image's size is the
    gradient by normalised device coordinates. A surfel has been seen where its gradient is not zero: it reached a
    pixel that the loss compares.

    Attributes:
        sums: (N,) float32.
        visits: (N,) float32, whole numbers.
    """

    def __init__(self, count: int, device: torch.device | None = None) -> None:
        self.sums, self.visits = (torch.zeros(count, dtype=torch.float32, device=device) for _ in range(2))

    def add(self, center_px: Tensor, width: int, height: int) -> None:
        """One iteration's (N, 2) gradients, in 1/pixel, from an image of width x height."""
        # a product with a vector: sums over a dimension of two are several times slower
        squares = torch.mv(center_px.square(), _half_squares(width, height, center_px.dtype, center_px.device))
        # x / sqrt(x): torch's reciprocal root is ten times as fast as its root
        norms = squares.clamp(min=TINY).rsqrt_().mul_(squares)
        self.sums, self.visits = (x.to(center_px.device) for x in (self.sums, self.visits))  # from a checkpoint
        self.sums += norms
        self.visits += norms.sign_()

    def means(self) -> Tensor:
        """(N,) over the iterations in which each was seen; 0 if in none."""
        return self.sums / self.visits.clamp(min=1)

    def state(self) -> dict[str, Tensor]:
        """Named tensors for a checkpoint."""
        return {"gradient_sums": self.sums, "visits": self.visits}

    @classmethod
    def of(cls, state: dict[str, Tensor]) -> ScreenGradients:
        """The way back from `state`."""
        gradients = cls(0)
        gradients.sums, gradients.visits = state["gradient_sums"].clone(), state["visits"].clone()
        return gradients


@lru_cache(maxsize=8)
def _half_squares(width: int, height: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    return torch.tensor([(width / 2) ** 2, (height / 2) ** 2], dtype=dtype, device=device)
