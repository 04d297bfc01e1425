"""The paper's decoder: every surfel stores its own attributes."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from room2dgs.primitives.activations import EXP, OPACITY_LOGIT_MAX, ScaleActivation, opacity_logit_of, opacity_of
from room2dgs.seeds.spawn import Spawned

NAMES = ("offsets", "rotations", "raw_scales", "opacity_logits", "sh_dc", "sh_rest")


@dataclass
class ExplicitDecoder:
    """S fixed seeds, k surfels each (a `Decoder`); float32 raw parameters.

    Attributes:
        positions: (S, 3) the seeds, fixed, metres.
        offsets: (S, k, 3) metres (eq. 9: p = v + O).
        rotations: (S, k, 4) quaternions (w, x, y, z) of any norm.
        raw_scales: (S, k, 2), see `activation`.
        opacity_logits: (S, k).
        sh_dc: (S, k, 1, 3).
        sh_rest: (S, k, (degree + 1)^2 - 1, 3), or None for degree 0.
        activation: what the raw scales mean.
    """

    positions: Tensor
    offsets: Tensor
    rotations: Tensor
    raw_scales: Tensor
    opacity_logits: Tensor
    sh_dc: Tensor
    sh_rest: Tensor | None = None
    activation: ScaleActivation = EXP

    def __post_init__(self) -> None:
        for parameter in self.parameters().values():
            parameter.requires_grad_(True)

    @property
    def per_seed(self) -> tuple[str, ...]:
        return tuple(self.parameters())

    def parameters(self) -> dict[str, Tensor]:
        values = {name: getattr(self, name) for name in NAMES}
        return {name: value for name, value in values.items() if value is not None}

    def fixed(self) -> dict[str, Tensor]:
        return {"positions": self.positions}

    def rows_of(self, spawned: Spawned, features: Tensor | None = None) -> dict[str, Tensor]:
        rest = 0 if self.sh_rest is None else self.sh_rest.shape[2]
        return _rows(spawned, rest, self.activation)

    def count(self) -> int:
        return self.opacity_logits.numel()

    def surfels(self, active_sh_degree: int) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        sh = self.sh_dc.flatten(0, 1)
        if active_sh_degree > 0:
            rest = (active_sh_degree + 1) ** 2 - 1
            sh = torch.cat([sh, self.sh_rest.flatten(0, 1)[:, :rest]], dim=1)
        return (
            (self.positions[:, None] + self.offsets).flatten(0, 1),
            self.rotations.flatten(0, 1),
            self.activation.scale_of(self.raw_scales).flatten(0, 1),
            opacity_of(self.opacity_logits).flatten(),
            sh,
        )

    def constrain(self) -> None:
        with torch.no_grad():
            self.activation.constrain_(self.raw_scales)
            self.opacity_logits.clamp_(-OPACITY_LOGIT_MAX, OPACITY_LOGIT_MAX)


def explicit_decoder(spawned: Spawned, sh_degree: int, activation: ScaleActivation = EXP) -> ExplicitDecoder:
    """A decoder whose surfels are the spawned ones; SH above degree 0 starts at zero."""
    return ExplicitDecoder(**_rows(spawned, (sh_degree + 1) ** 2 - 1, activation), activation=activation)


def _rows(spawned: Spawned, rest: int, activation: ScaleActivation) -> dict[str, Tensor]:
    rows = {
        "positions": spawned.positions.clone(),
        "offsets": spawned.offsets.clone(),
        "rotations": spawned.rotations.clone(),
        "raw_scales": activation.raw_of(spawned.scales),
        "opacity_logits": opacity_logit_of(spawned.opacities),
        "sh_dc": spawned.sh_dc[:, :, None].clone(),
    }
    if rest:
        rows["sh_rest"] = torch.zeros(*spawned.opacities.shape, rest, 3, dtype=torch.float32)
    return rows
