"""Primitives decoded from a feature of their seed by one small network (after Scaffold-GS and AtlasGS)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from room2dgs.primitives.activations import OPACITY_LOGIT_MAX, SCALE_MAX_M, SCALE_MIN_M, opacity_logit_of, opacity_of
from room2dgs.primitives.primitive import Primitive, Rates, Splats
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.decoder import DecoderKind
from room2dgs.seeds.hierarchy import Cells

HIDDEN = 32
FEATURE_STD = 0.1
OPACITY_GAIN = 10.0  # opacities learn ten times as fast as scales, as they do where primitives store their own
FACTOR_MIN, FACTOR_MAX = 0.1, 3.0  # of a primitive's scale to its seed's
FACTOR_ONE = math.log((1.0 - FACTOR_MIN) / (FACTOR_MAX - 1.0))  # where the factor is 1

PER_SEED = ("offsets", "rotations", "raw_scales", "sh_dc", "features")
NETWORK = ("hidden_weight", "hidden_bias", "out_weight", "out_bias")


@dataclass
class SharedDecoder:
    """S fixed seeds, k primitives each (a `Decoder`); float32 raw parameters, SH of degree 0.

    A seed has a rotation, scales and a colour; the network, which sees no view direction, turns the
    seed's feature into k opacities, k factors on the scales, and k summands to the quaternion and to
    the colour. No opacity is cut off at zero, so every primitive keeps its gradient.

    Attributes:
        primitive: what it decodes to, and what raw scales mean.
        positions: (S, 3) the seeds, fixed, metres.
        offsets: (S, k, 3) metres (eq. 9: p = v + O).
        rotations: (S, 4) quaternions (w, x, y, z) of any norm.
        raw_scales: (S, D), D numbers as the primitive has them.
        sh_dc: (S, 3).
        features: (S, F).
        hidden_weight, hidden_bias: (H, F), (H,) the layer before the ReLU.
        out_weight, out_bias: (sum of `_widths` times k, H) and (...,) the layer after it: k opacities, D k scales, ...
    """

    primitive: Primitive
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

    def __post_init__(self) -> None:
        for parameter in self.parameters().values():
            parameter.requires_grad_(True)

    @property
    def per_seed(self) -> tuple[str, ...]:
        return PER_SEED

    @property
    def separable(self) -> bool:
        return False

    def parameters(self) -> dict[str, Tensor]:
        return {name: getattr(self, name) for name in (*PER_SEED, *NETWORK)}

    def fixed(self) -> dict[str, Tensor]:
        return {"positions": self.positions}

    def with_tensors(self, fixed: dict[str, Tensor], parameters: dict[str, Tensor]) -> Self:
        tensors: dict[str, Any] = fixed | parameters
        return replace(self, **tensors)

    def rows_of(self, spawned: Spawned, families: Cells | None = None) -> dict[str, Tensor]:
        """See `Decoder.rows_of`; opacities are what the network makes of the features, not the spawned ones.

        A new seed's feature is the largest of its family's, element by element (Scaffold-GS); zeros without a family.
        """
        if families is None:
            features = self.features.new_zeros(len(spawned.positions), self.features.shape[1])
        else:
            values = self.features.detach().cpu().numpy()[families.order // self.offsets.shape[1]]
            features = torch.from_numpy(np.maximum.reduceat(values, families.first, axis=0))
        return _rows(spawned, self.primitive) | {"features": features.detach().clone()}

    def count(self) -> int:
        return self.offsets.shape[0] * self.offsets.shape[1]

    def splats(self, active_sh_degree: int) -> Splats:
        hidden = functional.relu(functional.linear(self.features, self.hidden_weight, self.hidden_bias))
        # a product for each part keeps its numbers together: half the time of one product cut in parts
        widths = _widths(self.raw_scales.shape[1])
        rows = [width * self.offsets.shape[1] for width in widths]
        layers = zip(self.out_weight.split(rows), self.out_bias.split(rows), strict=True)
        parts = [functional.linear(hidden, weight, bias) for weight, bias in layers]
        shape = self.offsets.shape[:2]
        logit, factor, turn, color = (part.view(*shape, width) for part, width in zip(parts, widths, strict=True))
        factors = FACTOR_MIN + (FACTOR_MAX - FACTOR_MIN) * torch.sigmoid(factor + FACTOR_ONE)
        scales = self.primitive.activation.scale_of(self.raw_scales)[:, None] * factors
        return self.primitive.splats(
            (self.positions[:, None] + self.offsets).flatten(0, 1),
            (self.rotations[:, None] + turn).flatten(0, 1),
            scales.flatten(0, 1),
            opacity_of(OPACITY_LOGIT_MAX * functional.softsign(logit * (OPACITY_GAIN / OPACITY_LOGIT_MAX))).flatten(),
            (self.sh_dc[:, None] + color).flatten(0, 1)[:, None],
        )

    def learning_rates(self, rates: Rates) -> dict[str, float]:
        network = dict.fromkeys(NETWORK, rates.network)
        return {"offsets": rates.center, **self.primitive.learning_rates(rates), "features": rates.feature, **network}

    def constrain(self) -> None:
        with torch.no_grad():
            self.primitive.activation.constrain_(self.raw_scales, SCALE_MIN_M / FACTOR_MIN, SCALE_MAX_M / FACTOR_MAX)


def shared_decoder(spawned: Spawned, primitive: Primitive, feature_size: int, seed: int) -> SharedDecoder:
    """A decoder whose primitives are the spawned discs, if those of a seed differ in their offsets alone.

    The last layer starts at zero but for the opacities; the random features make the seeds differ.

    Args:
        spawned: k discs for each of S seeds; opacities may differ between the k, not between seeds.
        primitive: what they become.
        feature_size: F.
        seed: the same number gives the same bits.
    """
    random = torch.Generator().manual_seed(seed % 2**63)
    seeds, per_seed = spawned.opacities.shape
    reach = 1.0 / math.sqrt(feature_size)
    logits = opacity_logit_of(spawned.opacities).mean(dim=0)
    own = _rows(spawned, primitive)
    outputs = per_seed * sum(_widths(own["raw_scales"].shape[1]))
    out_bias = torch.zeros(outputs, dtype=torch.float32)
    out_bias[:per_seed] = logits / (1.0 - logits.abs() / OPACITY_LOGIT_MAX) / OPACITY_GAIN  # softsign's inverse
    return SharedDecoder(
        primitive,
        **own,
        features=FEATURE_STD * torch.randn(seeds, feature_size, generator=random, dtype=torch.float32),
        hidden_weight=reach * (2 * torch.rand(HIDDEN, feature_size, generator=random, dtype=torch.float32) - 1),
        hidden_bias=reach * (2 * torch.rand(HIDDEN, generator=random, dtype=torch.float32) - 1),
        out_weight=torch.zeros(outputs, HIDDEN, dtype=torch.float32),
        out_bias=out_bias,
    )


SHARED = DecoderKind(
    lambda spawned, primitive, config, sh_degree, seed: shared_decoder(spawned, primitive, config.feature_size, seed),
    lambda primitive, fixed, parameters: SharedDecoder(primitive, **fixed, **parameters),
)


def _widths(scales: int) -> tuple[int, int, int, int]:
    """Outputs of the network for one primitive: opacity, factors of its scales, quaternion, colour."""
    return 1, scales, 4, 3


def _rows(spawned: Spawned, primitive: Primitive) -> dict[str, Tensor]:
    """What a seed has of its own, features aside."""
    return {
        "positions": spawned.positions.clone(),
        "offsets": spawned.offsets.clone(),
        "rotations": spawned.rotations[:, 0].clone(),
        "raw_scales": primitive.activation.raw_of(primitive.first_scales(spawned).log().mean(dim=1).exp()),
        "sh_dc": spawned.sh_dc.mean(dim=1),
    }
