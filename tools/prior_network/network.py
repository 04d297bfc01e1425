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
# at 1/32 and at 1/16: on so few cells they cost next to nothing
CONTEXT_BLOCKS, FINER_CONTEXT_BLOCKS = 4, 2
HEAD_WIDTH = 48
START_DEPTH_M, START_DISTANCE_M = 2.5, 1.5
LN_DEPTH_RANGE = (math.log(0.02), math.log(100.0))
LN_SCALE_RANGE = (-5.0, 0.7)
LN_KAPPA_RANGE = (-2.0, 4.5)
# ln depth, ln scale, normal, ln kappa, ln distance and share before any training: the middle of a room, a wall across
# the view, and depth for the most part from the pixel alone
HEAD_START = (math.log(START_DEPTH_M), -1.0, 0.0, 0.0, -1.0, 0.0, math.log(START_DISTANCE_M), 2.0)
# the least cosine between a normal and the direction to the camera, and that with which depth follows from a plane
LEAST_FACING, LEAST_PLANE_FACING = 0.01, 0.1
OUTPUT_STRIDE = 2


class Maps(NamedTuple):
    """Predictions.

    Attributes:
        ln_depth: (B, 1, h, w), depth in metres.
        ln_scale: (B, 1, h, w) logarithm of the Laplace scale of ln depth.
        normal: (B, 3, h, w) unit, OpenCV camera axes, facing the camera.
        ln_kappa: (B, 1, h, w) logarithm of the normal's concentration.
        ln_distance: (B, 1, h, w) logarithm of the camera's distance from the plane that touches the surface, metres.
    """

    ln_depth: Tensor
    ln_scale: Tensor
    normal: Tensor
    ln_kappa: Tensor
    ln_distance: Tensor


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

    Depth is a mixture, by pixel, of depth itself and of what the normal and the plane's distance say: a wall has one
    distance, however obliquely it is seen, so blank planes come out flat (Shao et al. 2023, NDDepth, eq. 3).
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder = Encoder()
        coarsest = DECODER_WIDTHS[-1]
        self.coarse = nn.Conv2d(FEATURE_WIDTHS[-1], coarsest, 1)
        self.coarse_rays = nn.Sequential(nn.Conv2d(2, 64, 1), nn.ReLU(), nn.Conv2d(64, coarsest, 1))
        self.context = nn.ModuleList([ContextBlock(coarsest) for _ in range(CONTEXT_BLOCKS)])
        self.finer_context = nn.ModuleList([ContextBlock(DECODER_WIDTHS[3]) for _ in range(FINER_CONTEXT_BLOCKS)])
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
        height, width = features[-1].shape[-2:]
        x = self.coarse(features[-1]) + self.coarse_rays(ray_slopes(intrinsics, height, width, 32))
        x = _with_context(x, self.context)
        for scale, rung in zip((3, 2, 1, 0), self.rungs, strict=True):
            height, width = features[scale].shape[-2:]
            slopes = ray_slopes(intrinsics, height, width, 2 ** (scale + 1))
            x = rung(x, features[scale], slopes)
            if scale == 3:
                x = _with_context(x, self.finer_context)
        with torch.autocast(x.device.type, enabled=False):  # what depth and angles are read off keeps its digits
            raw = self.heads(x.float())
        normal, ln_distance = facing(raw[:, 2:5], slopes), raw[:, 6:7]
        ln_depth = torch.lerp(ln_depth_of_plane(normal, ln_distance, slopes), raw[:, 0:1], raw[:, 7:8].sigmoid())
        return Maps(
            ln_depth.clamp(*LN_DEPTH_RANGE),
            raw[:, 1:2].clamp(*LN_SCALE_RANGE),
            normal,
            raw[:, 5:6].clamp(*LN_KAPPA_RANGE),
            ln_distance,
        )

    def _initialise(self) -> None:
        """He's initialisation; shortcuts start as identities and the heads at a room's middle."""
        for name, module in self.named_modules():
            if isinstance(module, nn.Conv2d) and not name.startswith("encoder"):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                assert module.bias is not None
                nn.init.zeros_(module.bias)
        with torch.no_grad():
            for rung in self.rungs:
                assert isinstance(rung, Rung)
                if rung.residual is not None:
                    _weights_of_last(rung.residual).mul_(0.1)
            for block in (*self.context, *self.finer_context):
                assert isinstance(block, ContextBlock)
                block.joined.weight.mul_(0.1)
                _weights_of_last(block.perceptron).mul_(0.1)
            _weights_of_last(self.heads).mul_(0.1)
            bias = self.heads[-1].bias
            assert isinstance(bias, Tensor)
            bias.copy_(torch.tensor(HEAD_START))


def _weights_of_last(layers: nn.Sequential) -> Tensor:
    weight = layers[-1].weight
    assert isinstance(weight, Tensor)
    return weight


class FullSize(nn.Module):
    """The network as it is exported: maps of the photo's size, in the units that the pipeline reads."""

    def __init__(self, network: PriorNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor, intrinsics: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """depth (B, 1, H, W) metres, its expected |error of ln depth|, normal (B, 3, H, W), its expected angle."""
        half = self.network(image, intrinsics)
        raw = F.interpolate(torch.cat(half[:4], dim=1), scale_factor=2.0, mode="bilinear", align_corners=False)
        slopes = ray_slopes(intrinsics, image.shape[-2], image.shape[-1], 1)
        normal = facing(raw[:, 2:5], slopes)
        return raw[:, 0:1].exp(), raw[:, 1:2].exp(), normal, expected_angle(raw[:, 5:6].exp())


def facing(vector: Tensor, slopes: Tensor) -> Tensor:
    """(B, 3, H, W) unit normals turned so far, and no further, that they face the camera."""
    normal = F.normalize(vector, dim=1, eps=1e-6)
    rays = unit_rays(slopes)
    away = F.relu((normal * rays).sum(dim=1, keepdim=True) + LEAST_FACING)
    return F.normalize(normal - away * rays, dim=1, eps=1e-6)


def ln_depth_of_plane(normal: Tensor, ln_distance: Tensor, slopes: Tensor) -> Tensor:
    """(B, 1, H, W) ln z of the plane n·X = -d along each ray; planes seen too obliquely count as at the limit."""
    rays = unit_rays(slopes)
    facing_camera = -(normal * rays).sum(dim=1, keepdim=True)
    return ln_distance + rays[:, 2:3].log() - facing_camera.clamp(min=LEAST_PLANE_FACING).log()


def _with_context(x: Tensor, blocks: nn.ModuleList) -> Tensor:
    """(B, C, H, W) whose cells have exchanged what they know."""
    tokens = x.flatten(2).transpose(1, 2)
    for block in blocks:
        tokens = block(tokens)
    return tokens.transpose(1, 2).reshape(x.shape)


def _two_convolutions(width: int, middle: int, last_kernel: int, out: int | None = None) -> nn.Sequential:
    """3x3, ReLU, and one more."""
    last = nn.Conv2d(middle, out or width, last_kernel, padding=last_kernel // 2)
    return nn.Sequential(nn.Conv2d(width, middle, 3, padding=1), nn.ReLU(inplace=True), last)
