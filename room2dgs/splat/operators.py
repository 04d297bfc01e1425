"""The rasterizer as operators of torch, with shapes for tracing, and as a differentiable function.

`torch.compile` and `torch.export` take `room2dgs::rasterize` and `room2dgs::rasterize_backward` whole.
"""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.kernels.operators import LIBRARY, operator
from room2dgs.splat import block_view, cpu_view

_SURFELS = "Tensor centers, Tensor rotations, Tensor scales, Tensor opacities, Tensor sh"
_CAMERA = "Tensor cam_from_world, Tensor K, Tensor background"
_OPTIONS = "SymInt width, SymInt height, float near_m, float opacity_floor, bool with_normal, bool with_distortion"
_TO_IMAGES = ", ".join(f"Tensor? to_{name}" for name in ("color", "alpha", "depth", "median", "normal", "distortion"))

rasterize = operator(
    f"rasterize({_SURFELS}, {_CAMERA}, Tensor? center_px, {_OPTIONS}) -> ({', '.join(['Tensor'] * 7)})",
    block_view.forward,
    cpu_view.forward,
)
rasterize_backward = operator(
    f"rasterize_backward({_SURFELS}, {_CAMERA}, Tensor alpha, Tensor depth, Tensor state, {_TO_IMAGES}, {_OPTIONS}, "
    f"bool with_background) -> ({', '.join(['Tensor'] * 9)})",
    block_view.backward,
    cpu_view.backward,
)


class Rasterize(torch.autograd.Function):
    """`rasterize`, differentiable: the six images and the state that its backward pass needs."""

    @staticmethod
    def forward(ctx, *inputs):  # a setup_context of its own would have torch inspect signatures at every call
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
        return *to, to_center_px if with_center_px else None, *[None] * len(ctx.options)


@torch.library.register_fake("room2dgs::rasterize", lib=LIBRARY)
def _(
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, center_px,
    width, height, near_m, opacity_floor, with_normal, with_distortion,
):  # fmt: skip
    return *cpu_view.empty_images(centers, width, height), torch.empty(2, dtype=torch.int64, device="cpu")


@torch.library.register_fake("room2dgs::rasterize_backward", lib=LIBRARY)
def _(
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, alpha, depth, state,
    to_color, to_alpha, to_depth, to_median, to_normal, to_distortion,
    width, height, near_m, opacity_floor, with_normal, with_distortion, with_background,
):  # fmt: skip
    *to, to_center_px = cpu_view.empty_gradients(centers, rotations, scales, opacities, sh)
    camera = (x.new_empty(x.shape) for x in (cam_from_world, K, background))
    return *to, *camera, to_center_px
