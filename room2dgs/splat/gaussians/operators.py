"""The rasterizer of 3D Gaussians as operators of torch, and as a differentiable function (see splat/operators.py)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.kernels.builds import Build
from room2dgs.kernels.operators import LIBRARY, operator
from room2dgs.splat import block_view, cpu_view, frames

FRAMES = frames.Kind(_C.GaussianFrame, torch.device("cpu"))

_GAUSSIANS = "Tensor centers, Tensor rotations, Tensor scales, Tensor opacities, Tensor sh"
_CAMERA = "Tensor cam_from_world, Tensor K, Tensor background"
_OPTIONS = (
    "SymInt width, SymInt height, float near_m, float opacity_floor, bool with_normal, bool with_distortion, "
    "float filter_px2, bool compensated"
)
_TO_IMAGES = ", ".join(f"Tensor? to_{name}" for name in ("color", "alpha", "depth", "median", "normal", "distortion"))
_OPTION_COUNT = 8
_BY_BLOCKS = "GaussianBlockFrame"


def _forward(*inputs: Any) -> tuple[Tensor, ...]:
    *others, filter_px2, compensated = inputs
    return cpu_view.forward(*others, kind=FRAMES, more=(filter_px2, compensated))


def _backward(*inputs: Any) -> tuple[Tensor, ...]:
    *others, filter_px2, compensated, with_background = inputs
    others.append(with_background)
    return cpu_view.backward(*others, kind=FRAMES, more=(filter_px2, compensated))


def _forward_by_blocks(build: Build, *inputs: Any) -> tuple[Tensor, ...]:
    *others, filter_px2, compensated = inputs
    return block_view.forward(build, *others, frame_class=_BY_BLOCKS, more=(filter_px2, compensated))


def _backward_by_blocks(build: Build, *inputs: Any) -> tuple[Tensor, ...]:
    *others, filter_px2, compensated, with_background = inputs
    others.append(with_background)
    return block_view.backward(build, *others, frame_class=_BY_BLOCKS, more=(filter_px2, compensated))


rasterize = operator(
    f"rasterize_gaussians({_GAUSSIANS}, {_CAMERA}, Tensor? center_px, {_OPTIONS}) -> ({', '.join(['Tensor'] * 7)})",
    _forward_by_blocks,
    _forward,
)
rasterize_backward = operator(
    f"rasterize_gaussians_backward({_GAUSSIANS}, {_CAMERA}, Tensor alpha, Tensor depth, Tensor state, {_TO_IMAGES}, "
    f"{_OPTIONS}, bool with_background) -> ({', '.join(['Tensor'] * 9)})",
    _backward_by_blocks,
    _backward,
)


class Rasterize(torch.autograd.Function):
    """`rasterize`, differentiable: the six images and the state that its backward pass needs."""

    @staticmethod
    def forward(ctx, *inputs):
        output = rasterize(*inputs)
        centers, rotations, scales, opacities, sh, cam_from_world, K, background, _, *ctx.options = inputs
        _, alpha, depth, *_, state = output
        ctx.save_for_backward(
            centers, rotations, scales, opacities, sh, cam_from_world, K, background, alpha, depth, state
        )
        ctx.set_materialize_grads(False)
        return output

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, *to_outputs: Tensor | None):
        *to_images, _ = to_outputs
        with_background, with_center_px = ctx.needs_input_grad[7:9]
        *to, to_center_px = rasterize_backward(*ctx.saved_tensors, *to_images, *ctx.options, with_background)
        return *to, to_center_px if with_center_px else None, *[None] * _OPTION_COUNT


@torch.library.register_fake("room2dgs::rasterize_gaussians", lib=LIBRARY)
def _(*inputs):
    centers, width, height = inputs[0], *inputs[9:11]
    return *cpu_view.empty_images(centers, width, height), torch.empty(2, dtype=torch.int64, device="cpu")


@torch.library.register_fake("room2dgs::rasterize_gaussians_backward", lib=LIBRARY)
def _(*inputs):
    *to, to_center_px = cpu_view.empty_gradients(*inputs[:5])
    camera = (x.new_empty(x.shape) for x in inputs[5:8])
    return *to, *camera, to_center_px
