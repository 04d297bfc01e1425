"""`cpu_view` as operators of torch, with shapes for tracing and an autograd formula.

`torch.compile` and `torch.export` take `room2dgs::rasterize` and `room2dgs::rasterize_backward` whole.
"""

from __future__ import annotations

import torch

from room2dgs.splat.backends import cpu_view

_SURFELS = "Tensor centers, Tensor rotations, Tensor scales, Tensor opacities, Tensor sh"
_VIEW = "Tensor cam_from_world, Tensor K, Tensor background"
_OPTIONS = "SymInt width, SymInt height, float near_m, float opacity_floor, bool with_normal, bool with_distortion"
_TO_IMAGES = ", ".join(f"Tensor? to_{name}" for name in ("color", "alpha", "depth", "median", "normal", "distortion"))

rasterize = torch.library.custom_op(
    "room2dgs::rasterize",
    cpu_view.forward,
    mutates_args=(),
    device_types="cpu",
    schema=f"({_SURFELS}, {_VIEW}, Tensor? center_px, {_OPTIONS}) -> ({', '.join(['Tensor'] * 7)})",
)
rasterize_backward = torch.library.custom_op(
    "room2dgs::rasterize_backward",
    cpu_view.backward,
    mutates_args=(),
    device_types="cpu",
    schema=f"({_SURFELS}, {_VIEW}, Tensor alpha, Tensor depth, Tensor state, {_TO_IMAGES}, {_OPTIONS}, "
    f"bool with_background) -> ({', '.join(['Tensor'] * 9)})",
)


@rasterize.register_fake
def _(
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, center_px,
    width, height, near_m, opacity_floor, with_normal, with_distortion,
):  # fmt: skip
    return *cpu_view.empty_images(centers, width, height), torch.empty(2, dtype=torch.int64, device="cpu")


@rasterize_backward.register_fake
def _(
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, alpha, depth, state,
    to_color, to_alpha, to_depth, to_median, to_normal, to_distortion,
    width, height, near_m, opacity_floor, with_normal, with_distortion, with_background,
):  # fmt: skip
    *to, to_center_px = cpu_view.empty_gradients(centers, rotations, scales, opacities, sh)
    view = (x.new_empty(x.shape) for x in (cam_from_world, K, background))
    return *to, *view, to_center_px


def _backward(ctx, *to_outputs):
    return cpu_view.gradients(ctx, to_outputs, rasterize_backward)


rasterize.register_autograd(_backward, setup_context=cpu_view.keep_for_backward)
