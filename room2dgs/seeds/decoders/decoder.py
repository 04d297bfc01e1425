"""What turns seeds into primitives: the interface that the training loop sees."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, Self

from torch import Tensor

from room2dgs.config import SeedsConfig
from room2dgs.primitives.primitive import Primitive, Rates, Splats
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.hierarchy import Cells


class Decoder(Protocol):
    """Seeds with learnable primitives, as named tensors.

    Seeds are added and pruned row by row: the parameters named by `per_seed` and all of `fixed()` have one
    row a seed, so that either is one gather for a tensor and its optimiser state alike.
    """

    @property
    def primitive(self) -> Primitive:
        """What it decodes to."""
        ...

    @property
    def per_seed(self) -> tuple[str, ...]:
        """Names of the parameters whose first dimension counts seeds; the others belong to all seeds."""
        ...

    @property
    def separable(self) -> bool:
        """Does each primitive have parameters of its own, (S, k, ...), so that its seed's others can go without it?"""
        ...

    def parameters(self) -> dict[str, Tensor]:
        """Learnable leaves by name, in a fixed order."""
        ...

    def fixed(self) -> dict[str, Tensor]:
        """Tensors that are not learnt but belong to the state, by name; one row a seed. "positions" is one of them."""
        ...

    def with_tensors(self, fixed: dict[str, Tensor], parameters: dict[str, Tensor]) -> Self:
        """The same decoder with other `fixed()` and `parameters()`; it keeps the tensors, which want gradients then."""
        ...

    def rows_of(self, spawned: Spawned, families: Cells | None = None) -> dict[str, Tensor]:
        """Rows for new seeds, by name: of every `per_seed` parameter and every `fixed()` tensor; detached.

        Args:
            spawned: the first discs of B seeds, k each as this decoder has.
            families: of each new seed, the primitives that it has grown from, by index: what it may inherit from;
                None: nothing.
        """
        ...

    def count(self) -> int:
        """Number of primitives."""
        ...

    def splats(self, active_sh_degree: int) -> Splats:
        """The primitives, activated; those of one seed are adjacent. Differentiable in `parameters()`."""
        ...

    def learning_rates(self, rates: Rates) -> dict[str, float]:
        """Adam's rate of each parameter, by name; others may be among them."""
        ...

    def constrain(self) -> None:
        """Bring parameters back into their bounds after a step."""
        ...


class DecoderKind(NamedTuple):
    """How a decoder is made.

    Attributes:
        new: from spawned discs, the primitive, settings, SH degree and random seed; the discs are its first primitives.
        restored: from the primitive and the tensors of `fixed()` and `parameters()` by name, which it keeps.
    """

    new: Callable[[Spawned, Primitive, SeedsConfig, int, int], Decoder]
    restored: Callable[[Primitive, dict[str, Tensor], dict[str, Tensor]], Decoder]
