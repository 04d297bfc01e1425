"""What turns seeds into surfels: the interface that the training loop sees."""

from __future__ import annotations

from typing import Protocol

from torch import Tensor

from room2dgs.seeds.spawn import Spawned


class Decoder(Protocol):
    """Seeds with learnable surfels.

    Seeds are added and pruned row by row: the parameters named by `per_seed` and all of `fixed()` have one
    row a seed, so that either is one gather for a tensor and its optimiser state alike.
    """

    @property
    def per_seed(self) -> tuple[str, ...]:
        """Names of the parameters whose first dimension counts seeds; the others belong to all seeds."""
        ...

    def parameters(self) -> dict[str, Tensor]:
        """Learnable leaves by name, in a fixed order."""
        ...

    def fixed(self) -> dict[str, Tensor]:
        """Tensors that are not learnt but belong to the state, by name; one row a seed."""
        ...

    def rows_of(self, spawned: Spawned, features: Tensor | None = None) -> dict[str, Tensor]:
        """Rows for new seeds, by name: of every `per_seed` parameter and every `fixed()` tensor; detached.

        Args:
            spawned: the first surfels of B seeds, k each as this decoder has.
            features: (B, F) what the seeds start from, such as their parents' features (None: zeros);
                decoders without a parameter "features" ignore it.
        """
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
