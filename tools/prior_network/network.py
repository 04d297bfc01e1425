"""The network: encoder, context, decoder, heads."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from room2dgs.tools.prior_network.angular import expected_angle
from room2dgs.tools.prior_network.context import ContextBlock
from room2dgs.tools.prior_network.encoder import FEATURE_WIDTHS, Encoder
from room2dgs.tools.prior_network.rays import ray_slopes, unit_rays

# by scale, 1/2 to 1/32
DECODER_WIDTHS = (24, 64, 96, 128, 192)
CONTEXT_BLOCKS = 2
HEAD_WIDTH = 48
START_DEPTH_M = 2.5
LN_DEPTH_RANGE = (math.log(0.02), math.log(100.0))
LN_SCALE_RANGE = (-5.0, 0.7)
LN_KAPPA_RANGE = (-2.0, 4.5)
# ln depth, ln scale, normal, ln kappa before any training: the middle of a room, and a wall across the view
HEAD_START = (math.log(START_DEPTH_M), -1.0, 0.0, 0.0, -1.0, 0.0)
# the least cosine between a normal and the direction to the camera
LEAST_FACING = 0.01
OUTPUT_STRIDE = 2


class Maps(NamedTuple):
    """Predictions.

    Attributes:
        ln_depth: (B, 1, h, w), depth in metres.
        ln_scale: (B, 1, h, w) logarithm of the Laplace scale of ln depth.
        normal: (B, 3, h, w) unit, OpenCV camera axes, facing the camera.
        ln_kappa: (B, 1, h, w) logarithm of the normal's concentration.
    """

    ln_depth: Tensor
    ln_scale: Tensor
    normal: Tensor
    ln_kappa: Tensor


class Rung(nn.Module):
    """One scale of the decoder: what comes from below, the encoder's features and the rays, then a residual unit.

    The finest has no residual unit: it would cost as much as all others.
    """

    def __init__(self, scale: int) -> None:
        super().__init__()
        width, below, feature_width = DECODER_WIDTHS[scale], DECODER_WIDTHS[scale + 1], FEATURE_WIDTHS[scale]
        self.from_below = nn.Conv2d(below, width, 1)
        self.from_encoder = nn.Conv2d(feature_width, width, 1)
        self.from_rays = nn.Conv2d(2, width, 1)
        self.residual = None if scale == 0 else _two_convolutions(width, width, 3)

    def forward(self, below: Tensor, feature: Tensor, slopes: Tensor) -> Tensor:
        up = F.interpolate(self.from_below(below), scale_factor=2.0, mode="bilinear", align_corners=False)
        x = F.relu(up + self.from_encoder(feature) + self.from_rays(slopes), inplace=True)
        return x if self.residual is None else F.relu(x + self.residual(x), inplace=True)


class PriorNetwork(nn.Module):
    """Depth, normals and their expected errors from one photo and its intrinsics.

    No layer depends on statistics of a batch. The rays enter at every scale of the decoder: what a wall's direction
    is in camera axes, and how large a thing is, can't be told from pixels without them.
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder = Encoder()
        coarsest = DECODER_WIDTHS[-1]
        self.coarse = nn.Conv2d(FEATURE_WIDTHS[-1], coarsest, 1)
        self.coarse_rays = nn.Sequential(nn.Conv2d(2, 64, 1), nn.ReLU(), nn.Conv2d(64, coarsest, 1))
        self.context = nn.ModuleList([ContextBlock(coarsest) for _ in range(CONTEXT_BLOCKS)])
        self.rungs = nn.ModuleList(Rung(scale) for scale in (3, 2, 1, 0))
        self.heads = _two_convolutions(DECODER_WIDTHS[0], HEAD_WIDTH, 1, len(HEAD_START))
        self._initialise()

    def forward(self, image: Tensor, intrinsics: Tensor) -> Maps:
        """Maps at half the photo's size; see `full_size`.

        Args:
            image: (B, 3, H, W) RGB in [0, 1]; H and W multiples of 32.
            intrinsics: (B, 3, 3) in pixels of the image, centres at +0.5.
        """
        features = self.encoder(image)
        x = self._with_context(features[-1], intrinsics)
        for scale, rung in zip((3, 2, 1, 0), self.rungs, strict=True):
            height, width = features[scale].shape[-2:]
            slopes = ray_slopes(intrinsics, height, width, 2 ** (scale + 1))
            x = rung(x, features[scale], slopes)
        raw = self.heads(x)
        return Maps(
            raw[:, 0:1].clamp(*LN_DEPTH_RANGE),
            raw[:, 1:2].clamp(*LN_SCALE_RANGE),
            facing(raw[:, 2:5], slopes),
            raw[:, 5:6].clamp(*LN_KAPPA_RANGE),
        )

    def _with_context(self, feature: Tensor, intrinsics: Tensor) -> Tensor:
        height, width = feature.shape[-2:]
        x = self.coarse(feature) + self.coarse_rays(ray_slopes(intrinsics, height, width, 32))
        tokens = x.flatten(2).transpose(1, 2)
        for block in self.context:
            tokens = block(tokens)
        return tokens.transpose(1, 2).reshape(x.shape)

    def _initialise(self) -> None:
        """He's initialisation; shortcuts start as identities and the heads at a room's middle."""
        for name, module in self.named_modules():
            if isinstance(module, nn.Conv2d) and not name.startswith("encoder"):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                nn.init.zeros_(module.bias)
        with torch.no_grad():
            for rung in self.rungs:
                if rung.residual is not None:
                    rung.residual[-1].weight.mul_(0.1)
            for block in self.context:
                block.joined.weight.mul_(0.1)
                block.perceptron[-1].weight.mul_(0.1)
            self.heads[-1].weight.mul_(0.1)
            self.heads[-1].bias.copy_(torch.tensor(HEAD_START))


class FullSize(nn.Module):
    """The network as it is exported: maps of the photo's size, in the units that the pipeline reads."""

    def __init__(self, network: PriorNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor, intrinsics: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """depth (B, 1, H, W) metres, its expected |error of ln depth|, normal (B, 3, H, W), its expected angle."""
        half = self.network(image, intrinsics)
        raw = F.interpolate(torch.cat(half, dim=1), scale_factor=2.0, mode="bilinear", align_corners=False)
        slopes = ray_slopes(intrinsics, image.shape[-2], image.shape[-1], 1)
        normal = facing(raw[:, 2:5], slopes)
        return raw[:, 0:1].exp(), raw[:, 1:2].exp(), normal, expected_angle(raw[:, 5:6].exp())


def facing(vector: Tensor, slopes: Tensor) -> Tensor:
    """(B, 3, H, W) unit normals turned so far, and no further, that they face the camera."""
    normal = F.normalize(vector, dim=1, eps=1e-6)
    rays = unit_rays(slopes)
    away = F.relu((normal * rays).sum(dim=1, keepdim=True) + LEAST_FACING)
    return F.normalize(normal - away * rays, dim=1, eps=1e-6)


def _two_convolutions(width: int, middle: int, last_kernel: int, out: int | None = None) -> nn.Sequential:
    """3x3, ReLU, and one more."""
    last = nn.Conv2d(middle, out or width, last_kernel, padding=last_kernel // 2)
    return nn.Sequential(nn.Conv2d(width, middle, 3, padding=1), nn.ReLU(inplace=True), last)
