"""The paper's decoder: every surfel stores its own attributes."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from room2dgs.seeds.activations import (
    LOG_SCALE_MAX,
    LOG_SCALE_MIN,
    OPACITY_LOGIT_MAX,
    log_scale_of,
    opacity_logit_of,
    opacity_of,
    scale_of,
)
from room2dgs.seeds.spawn import Spawned


@dataclass
class ExplicitDecoder:
    """S fixed seeds, k surfels each (a `Decoder`); float32 raw parameters.

    Attributes:
        positions: (S, 3) the seeds, fixed, metres.
        offsets: (S, k, 3) metres (eq. 9: p = v + O).
        rotations: (S, k, 4) quaternions (w, x, y, z) of any norm.
        log_scales: (S, k, 2).
        opacity_logits: (S, k).
        sh_dc: (S, k, 1, 3).
        sh_rest: (S, k, (degree + 1)^2 - 1, 3), or None for degree 0.
    """

    positions: Tensor
    offsets: Tensor
    rotations: Tensor
    log_scales: Tensor
    opacity_logits: Tensor
    sh_dc: Tensor
    sh_rest: Tensor | None = None

    def __post_init__(self) -> None:
        for parameter in self.parameters().values():
            parameter.requires_grad_(True)

    def parameters(self) -> dict[str, Tensor]:
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "positions"}
        return {name: value for name, value in values.items() if value is not None}

    def fixed(self) -> dict[str, Tensor]:
        return {"positions": self.positions}

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
            scale_of(self.log_scales).flatten(0, 1),
            opacity_of(self.opacity_logits).flatten(),
            sh,
        )

    def constrain(self) -> None:
        with torch.no_grad():
            self.log_scales.clamp_(LOG_SCALE_MIN, LOG_SCALE_MAX)
            self.opacity_logits.clamp_(-OPACITY_LOGIT_MAX, OPACITY_LOGIT_MAX)


def explicit_decoder(spawned: Spawned, sh_degree: int) -> ExplicitDecoder:
    """A decoder whose surfels are the spawned ones; SH above degree 0 starts at zero."""
    seeds, per_seed = spawned.opacities.shape
    rest = (sh_degree + 1) ** 2 - 1
    return ExplicitDecoder(
        positions=spawned.positions.clone(),
        offsets=spawned.offsets.clone(),
        rotations=spawned.rotations.clone(),
        log_scales=log_scale_of(spawned.scales),
        opacity_logits=opacity_logit_of(spawned.opacities),
        sh_dc=spawned.sh_dc[:, :, None].clone(),
        sh_rest=torch.zeros(seeds, per_seed, rest, 3) if rest else None,
    )
