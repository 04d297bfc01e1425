"""Each view's depth as it was last rendered: a neighbour's depth without a second rendering."""

from __future__ import annotations

import torch
from torch import Tensor

STEP = 2  # every other row and column is kept
MIN_ALPHA = 0.5  # pixels less covered have no depth


class KeptDepths:
    """Inverse depths by view, at most an epoch old, detached; of one image size.

    Inverse depth is linear in the image on a plane: interpolated between the kept pixels it is the plane's own.
    """

    def __init__(self) -> None:
        self._fraction = 1.0
        self._kept: dict[int, Tensor] = {}

    def keep(self, index: int, fraction: float, depth: Tensor, alpha: Tensor) -> None:
        """Keep a rendering's depth; those of another image size are forgotten.

        Args:
            index: the view.
            fraction: the image's size.
            depth, alpha: (H, W) of the rendering.
        """
        self._at(fraction)
        depth, alpha = (values.detach()[::STEP, ::STEP] for values in (depth, alpha))
        there = (alpha >= MIN_ALPHA) & (depth > 0)
        self._kept[index] = torch.where(there, 1 / torch.where(there, depth, 1.0), 0.0)

    def get(self, index: int, fraction: float) -> Tensor | None:
        """(h, w) inverse depth of every `STEP`-th row and column, 1/m, 0 = none; None if none is kept."""
        return self._kept.get(index) if fraction == self._fraction else None

    def state(self) -> dict[str, Tensor]:
        """All that is kept, for a checkpoint."""
        return {str(index): values for index, values in self._kept.items()}

    def load(self, state: dict[str, Tensor], fraction: float) -> None:
        """The way back from `state`; `fraction` is that of the last `keep`."""
        self._fraction = fraction
        self._kept = {int(index): values for index, values in state.items()}

    def _at(self, fraction: float) -> None:
        if fraction != self._fraction:
            self._fraction, self._kept = fraction, {}
