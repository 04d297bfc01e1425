"""Surfels decoded from a feature of their seed by one small network (after Scaffold-GS and AtlasGS)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from room2dgs.primitives.activations import (
    EXP,
    OPACITY_LOGIT_MAX,
    SCALE_MAX_M,
    SCALE_MIN_M,
    ScaleActivation,
    opacity_logit_of,
    opacity_of,
)
from room2dgs.seeds.spawn import Spawned

HIDDEN = 32
FEATURE_STD = 0.1
OPACITY_GAIN = 10.0  # opacities learn ten times as fast as scales, as they do where surfels store their own
WIDTHS = (1, 2, 4, 3)  # outputs of the network for a surfel: opacity, scale factors, quaternion, colour
FACTOR_MIN, FACTOR_MAX = 0.1, 3.0  # of a surfel's scale to its seed's
FACTOR_ONE = math.log((1.0 - FACTOR_MIN) / (FACTOR_MAX - 1.0))  # where the factor is 1

PER_SEED = ("offsets", "rotations", "raw_scales", "sh_dc", "features")
NETWORK = ("hidden_weight", "hidden_bias", "out_weight", "out_bias")


@dataclass
class SharedDecoder:
    """S fixed seeds, k surfels each (a `Decoder`); float32 raw parameters, SH of degree 0.

    A seed has a rotation, scales and a colour; the network, which sees no view direction, turns the
    seed's feature into k opacities, k factors on the scales, and k summands to the quaternion and to
    the colour. No opacity is cut off at zero, so every surfel keeps its gradient.

    Attributes:
        positions: (S, 3) the seeds, fixed, metres.
        offsets: (S, k, 3) metres (eq. 9: p = v + O).
        rotations: (S, 4) quaternions (w, x, y, z) of any norm.
        raw_scales: (S, 2), see `activation`.
        sh_dc: (S, 3).
        features: (S, F).
        hidden_weight, hidden_bias: (H, F), (H,) the layer before the ReLU.
        out_weight, out_bias: (10 k, H), (10 k,) the layer after it: k opacities, 2 k scales, ...
        activation: what the raw scales mean.
    """

    positions: Tensor
    offsets: Tensor
    rotations: Tensor
    raw_scales: Tensor
    sh_dc: Tensor
    features: Tensor
    hidden_weight: Tensor
    hidden_bias: Tensor
    out_weight: Tensor
    out_bias: Tensor
    activation: ScaleActivation = EXP

    def __post_init__(self) -> None:
        for parameter in self.parameters().values():
            parameter.requires_grad_(True)

    @property
    def per_seed(self) -> tuple[str, ...]:
        return PER_SEED

    def parameters(self) -> dict[str, Tensor]:
        return {name: getattr(self, name) for name in (*PER_SEED, *NETWORK)}

    def fixed(self) -> dict[str, Tensor]:
        return {"positions": self.positions}

    def rows_of(self, spawned: Spawned, features: Tensor | None = None) -> dict[str, Tensor]:
        """See `Decoder.rows_of`; opacities are what the network makes of `features`, not the spawned ones."""
        rows = _rows(spawned, self.activation)
        if features is None:
            features = self.features.new_zeros(len(spawned.positions), self.features.shape[1])
        return rows | {"features": features.detach().clone()}

    def count(self) -> int:
        return self.offsets.shape[0] * self.offsets.shape[1]

    def surfels(self, active_sh_degree: int) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        hidden = functional.relu(functional.linear(self.features, self.hidden_weight, self.hidden_bias))
        # a product for each part keeps its numbers together: half the time of one product cut in parts
        rows = [width * self.offsets.shape[1] for width in WIDTHS]
        layers = zip(self.out_weight.split(rows), self.out_bias.split(rows), strict=True)
        parts = [functional.linear(hidden, weight, bias) for weight, bias in layers]
        shape = self.offsets.shape[:2]
        logit, factor, turn, color = (part.view(*shape, width) for part, width in zip(parts, WIDTHS, strict=True))
        factors = FACTOR_MIN + (FACTOR_MAX - FACTOR_MIN) * torch.sigmoid(factor + FACTOR_ONE)
        scales = self.activation.scale_of(self.raw_scales)[:, None] * factors
        return (
            (self.positions[:, None] + self.offsets).flatten(0, 1),
            (self.rotations[:, None] + turn).flatten(0, 1),
            scales.flatten(0, 1),
            opacity_of(OPACITY_LOGIT_MAX * functional.softsign(logit * (OPACITY_GAIN / OPACITY_LOGIT_MAX))).flatten(),
            (self.sh_dc[:, None] + color).flatten(0, 1)[:, None],
        )

    def constrain(self) -> None:
        with torch.no_grad():
            self.activation.constrain_(self.raw_scales, SCALE_MIN_M / FACTOR_MIN, SCALE_MAX_M / FACTOR_MAX)


def shared_decoder(spawned: Spawned, feature_size: int, seed: int, activation: ScaleActivation = EXP) -> SharedDecoder:
    """A decoder whose surfels are the spawned ones, if those of a seed differ in their offsets alone.

    The last layer starts at zero but for the opacities; the random features make the seeds differ.

    Args:
        spawned: k surfels for each of S seeds; opacities may differ between the k, not between seeds.
        feature_size: F.
        seed: the same number gives the same bits.
    """
    random = torch.Generator().manual_seed(seed % 2**63)
    seeds, surfels = spawned.opacities.shape
    reach = 1.0 / math.sqrt(feature_size)
    logits = opacity_logit_of(spawned.opacities).mean(dim=0)
    out_bias = torch.zeros(surfels * sum(WIDTHS), dtype=torch.float32)
    out_bias[:surfels] = logits / (1.0 - logits.abs() / OPACITY_LOGIT_MAX) / OPACITY_GAIN  # softsign's inverse
    return SharedDecoder(
        **_rows(spawned, activation),
        features=FEATURE_STD * torch.randn(seeds, feature_size, generator=random, dtype=torch.float32),
        hidden_weight=reach * (2 * torch.rand(HIDDEN, feature_size, generator=random, dtype=torch.float32) - 1),
        hidden_bias=reach * (2 * torch.rand(HIDDEN, generator=random, dtype=torch.float32) - 1),
        out_weight=torch.zeros(surfels * sum(WIDTHS), HIDDEN, dtype=torch.float32),
        out_bias=out_bias,
        activation=activation,
    )


def _rows(spawned: Spawned, activation: ScaleActivation) -> dict[str, Tensor]:
    """What a seed has of its own, features aside."""
    return {
        "positions": spawned.positions.clone(),
        "offsets": spawned.offsets.clone(),
        "rotations": spawned.rotations[:, 0].clone(),
        "raw_scales": activation.raw_of(spawned.scales.log().mean(dim=1).exp()),
        "sh_dc": spawned.sh_dc.mean(dim=1),
    }
