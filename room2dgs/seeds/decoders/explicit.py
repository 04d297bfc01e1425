"""The paper's decoder: every primitive stores its own attributes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import torch
from torch import Tensor

from room2dgs.primitives.primitive import OFFSETS, SH_REST, Primitive, Rates, Splats
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.decoder import DecoderKind
from room2dgs.seeds.hierarchy import Cells


@dataclass
class ExplicitDecoder:
    """S fixed seeds, k primitives each (a `Decoder`); float32 raw parameters.

    Attributes:
        primitive: what the raw parameters mean.
        positions: (S, 3) the seeds, fixed, metres.
        leaves: by name, (S, k, ...): "offsets", (S, k, 3) metres (eq. 9: p = v + O), then the primitive's own.
    """

    primitive: Primitive
    positions: Tensor
    leaves: dict[str, Tensor]

    def __post_init__(self) -> None:
        for parameter in self.leaves.values():
            parameter.requires_grad_(True)

    @property
    def per_seed(self) -> tuple[str, ...]:
        return tuple(self.leaves)

    @property
    def separable(self) -> bool:
        return True

    def parameters(self) -> dict[str, Tensor]:
        return dict(self.leaves)

    def fixed(self) -> dict[str, Tensor]:
        return {"positions": self.positions}

    def with_tensors(self, fixed: dict[str, Tensor], parameters: dict[str, Tensor]) -> Self:
        return replace(self, positions=fixed["positions"], leaves={name: parameters[name] for name in self.leaves})

    def rows_of(self, spawned: Spawned, families: Cells | None = None) -> dict[str, Tensor]:
        rest = self.leaves[SH_REST].shape[2] if SH_REST in self.leaves else 0
        return {"positions": spawned.positions.clone(), **_first_leaves(spawned, self.primitive, rest)}

    def count(self) -> int:
        return self.leaves[OFFSETS].shape[0] * self.leaves[OFFSETS].shape[1]

    def splats(self, active_sh_degree: int) -> Splats:
        return self.primitive.activated(self.positions[:, None] + self.leaves[OFFSETS], self.leaves, active_sh_degree)

    def learning_rates(self, rates: Rates) -> dict[str, float]:
        return {OFFSETS: rates.center, **self.primitive.learning_rates(rates)}

    def constrain(self) -> None:
        with torch.no_grad():
            self.primitive.constrain_(self.leaves)


def explicit_decoder(spawned: Spawned, primitive: Primitive, sh_degree: int) -> ExplicitDecoder:
    """A decoder whose primitives are the spawned discs; SH above degree 0 starts at zero."""
    leaves = _first_leaves(spawned, primitive, (sh_degree + 1) ** 2 - 1)
    return ExplicitDecoder(primitive, spawned.positions.clone(), leaves)


def restored(primitive: Primitive, fixed: dict[str, Tensor], parameters: dict[str, Tensor]) -> ExplicitDecoder:
    """From its tensors by name, which it keeps."""
    names = (name for name in (OFFSETS, *primitive.parameters) if name in parameters)
    return ExplicitDecoder(primitive, fixed["positions"], {name: parameters[name] for name in names})


EXPLICIT = DecoderKind(
    lambda spawned, primitive, config, sh_degree, seed: explicit_decoder(spawned, primitive, sh_degree), restored
)


def _first_leaves(spawned: Spawned, primitive: Primitive, sh_rest: int) -> dict[str, Tensor]:
    return {OFFSETS: spawned.offsets.clone(), **primitive.first_parameters(spawned, sh_rest)}
