"""The network: a small U-Net over a view's evidence, with self-attention where its cells are few."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from room2dgs.depth.completion.evidence import CHANNELS, PRIOR, SAMPLE
from room2dgs.tools.prior_network.context import ContextBlock

WIDTHS = (16, 40, 80, 128)  # by scale, 1/1 to 1/8
CONTEXT_BLOCKS = 2
STRIDE = 2 ** (len(WIDTHS) - 1)
FINE = 20.0  # ratios of depths are also seen so many times larger, and bounded: centimetres matter, decimetres occur
LARGEST_SHIFT = 1.5
LN_SCALE_RANGE = (-7.0, 0.5)
START_LN_SCALE = -3.5


class Correction(NamedTuple):
    """What the network says.

    Attributes:
        shift: (B, h, w) to add to ln depth.
        ln_scale: (B, h, w) logarithm of the Laplace scale of ln depth then: of its expected relative error.
    """

    shift: Tensor
    ln_scale: Tensor


class ResidualUnit(nn.Module):
    """Two 3x3 convolutions beside a shortcut."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = (nn.Conv2d(width, width, 3, padding=1) for _ in range(2))

    def forward(self, x: Tensor) -> Tensor:
        """The same shape."""
        return F.relu(x + self.second(F.relu(self.first(x))))


class CorrectionNetwork(nn.Module):
    """How far off a completed depth is, from what speaks for it and against it (`evidence`)."""

    def __init__(self) -> None:
        super().__init__()
        pairs = list(pairwise(WIDTHS))
        self.stem = nn.Conv2d(CHANNELS + 2, WIDTHS[0], 3, padding=1)
        self.finest = ResidualUnit(WIDTHS[0])
        self.down = nn.ModuleList(nn.Conv2d(finer, coarser, 4, 2, 1) for finer, coarser in pairs)
        self.encoder = nn.ModuleList(nn.Sequential(ResidualUnit(width), ResidualUnit(width)) for width in WIDTHS[1:])
        self.context = nn.ModuleList(ContextBlock(WIDTHS[-1]) for _ in range(CONTEXT_BLOCKS))
        self.up = nn.ModuleList(nn.Conv2d(coarser, finer, 1) for finer, coarser in pairs)
        self.decoder = nn.ModuleList(ResidualUnit(width) for width in WIDTHS[:-1])
        self.head = nn.Conv2d(WIDTHS[0], 2, 3, padding=1)
        self._initialise()

    def forward(self, evidence: Tensor) -> Correction:
        """
        Args:
            evidence: (B, CHANNELS, h, w); h and w multiples of STRIDE.
        """
        fine = torch.tanh(FINE * torch.cat([evidence[:, PRIOR : PRIOR + 1], evidence[:, SAMPLE : SAMPLE + 1]], dim=1))
        features = [self.finest(F.relu(self.stem(torch.cat([evidence, fine], dim=1))))]
        for down, encoder in zip(self.down, self.encoder, strict=True):
            features.append(encoder(F.relu(down(features[-1]))))
        x = features[-1]
        tokens = x.flatten(2).transpose(1, 2)
        for block in self.context:
            tokens = block(tokens)
        x = tokens.transpose(1, 2).reshape(x.shape)
        for scale in reversed(range(len(WIDTHS) - 1)):
            from_below = F.interpolate(self.up[scale](x), scale_factor=2.0, mode="bilinear", align_corners=False)
            x = self.decoder[scale](F.relu(from_below + features[scale]))
        shift, ln_scale = self.head(x).float().unbind(1)
        return Correction(shift.clamp(-LARGEST_SHIFT, LARGEST_SHIFT), ln_scale.clamp(*LN_SCALE_RANGE))

    def _initialise(self) -> None:
        """Units start as identities, and depth hardly changes."""
        with torch.no_grad():
            for module in self.modules():
                if isinstance(module, ResidualUnit):
                    for convolution in (module.first, module.second):
                        nn.init.kaiming_normal_(convolution.weight, nonlinearity="relu")
                        assert convolution.bias is not None
                        nn.init.zeros_(convolution.bias)
                    module.second.weight.mul_(0.1)
                elif isinstance(module, ContextBlock):
                    module.joined.weight.mul_(0.1)
                    last = module.perceptron[-1]
                    assert isinstance(last, nn.Linear)
                    last.weight.mul_(0.1)
            self.head.weight.mul_(0.05)
            assert self.head.bias is not None
            self.head.bias.copy_(torch.tensor([0.0, START_LN_SCALE]))


class WithErrors(nn.Module):
    """The network as it is exported."""

    def __init__(self, network: CorrectionNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, evidence: Tensor) -> tuple[Tensor, Tensor]:
        """What to add to ln depth, and the relative error to be expected then, Laplace's median; (B, h, w) each."""
        shift, ln_scale = self.network(evidence)
        return shift, math.log(2) * ln_scale.exp()
