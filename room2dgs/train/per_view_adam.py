"""A few numbers of each view with an Adam of their own: they learn when the view is rendered."""

from __future__ import annotations

import torch
from torch import Tensor

BETAS = 0.9, 0.999
EPSILON = 1e-15  # as the surfels' Adam: gradients of a mean over pixels are tiny


class PerViewAdam:
    """(V, P) float64 numbers, zeros at first, and Adam whose moments and step counts are each row's own.

    A row is changed only by its own gradients: with one view an iteration, a common Adam would go on moving the rows of
    all others.
    """

    def __init__(self, views: int, numbers: int, device: torch.device | None = None) -> None:
        self.values, self._mean, self._square = (
            torch.zeros(views, numbers, dtype=torch.float64, device=device) for _ in range(3)
        )
        self._steps = [0] * views

    def step(self, row: int, gradient: Tensor, rates: Tensor) -> None:
        """One step of Adam for one row.

        Args:
            gradient, rates: (P,) float64.
        """
        first, second = BETAS
        self._steps[row] += 1
        self._mean[row] = first * self._mean[row] + (1 - first) * gradient
        self._square[row] = second * self._square[row] + (1 - second) * gradient**2
        count = self._steps[row]
        mean, square = self._mean[row] / (1 - first**count), self._square[row] / (1 - second**count)
        self.values[row] -= rates * mean / (square.sqrt() + EPSILON)

    def state(self) -> dict[str, Tensor]:
        """For a checkpoint."""
        return {
            "values": self.values,
            "mean": self._mean,
            "square": self._square,
            "steps": torch.tensor(self._steps, dtype=torch.int64),
        }

    def load(self, state: dict[str, Tensor]) -> None:
        """The way back from `state`.

        Raises:
            ValueError: it is of another number of views.
        """
        for name, own in self.state().items():
            if state[name].shape != own.shape or state[name].dtype != own.dtype:
                raise ValueError(f"{name} is of shape {tuple(state[name].shape)}, not {tuple(own.shape)}")
        self.values, self._mean, self._square = (
            state[name].clone().to(self.values.device) for name in ("values", "mean", "square")
        )
        self._steps = state["steps"].tolist()
