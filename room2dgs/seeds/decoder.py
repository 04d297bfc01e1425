"""What turns seeds into surfels: the interface that the training loop sees."""

from __future__ import annotations

from typing import Protocol

from torch import Tensor


class Decoder(Protocol):
    """Seeds with learnable surfels.

    Every parameter's first dimension counts seeds (or belongs to all seeds together), so that a later
    birth or death of seeds is one gather for a parameter and its optimiser state alike.
    """

    def parameters(self) -> dict[str, Tensor]:
        """Learnable leaves by name, in a fixed order."""
        ...

    def fixed(self) -> dict[str, Tensor]:
        """Tensors that are not learnt but belong to the state, by name."""
        ...

    def count(self) -> int:
        """Number of surfels."""
        ...

    def surfels(self, active_sh_degree: int) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Centres (N, 3), rotations (N, 4), scales (N, 2), opacities (N,), SH (N, (degree + 1)^2, 3).

        Activated, in the order of `splat.Surfels`' fields; surfels of one seed are adjacent.
        Differentiable with respect to `parameters()`.
        """
        ...

    def constrain(self) -> None:
        """Bring parameters back into their bounds after a step."""
        ...
