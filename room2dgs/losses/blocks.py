"""The fused losses by the kernels written for CUDA: on a GPU's tensors, or as plain C++ on the CPU's, for tests and for
the multi-view terms.

What they compute is `photometric.rgb_loss`, `surface.normal_consistency`, `depth_prior.depth_prior_loss`,
`normal_prior.normal_prior_loss` and the terms of `multiview`. Nothing waits for the device: values are tensors there,
and cameras are read there.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.block_code import PLAIN, build_for
from room2dgs.geometry.arguments import check_same_device, check_tensor, whole_number
from room2dgs.kernel_calls import call
from room2dgs.losses.checks import check_grey, check_images, check_intrinsics, check_mask, check_pose, check_step
from room2dgs.losses.known_gradients import with_gradients

LEVELS = 4  # of the depth prior's differences, at most
MOST_SAMPLES = 31  # of a patch's side


def rgb_loss(rendered: Tensor, target: Tensor, dssim: float) -> Tensor:
    """`photometric.rgb_loss` of float32 images on one device; differentiable once with respect to `rendered`."""
    losses, queue = _losses(rendered)
    gradient = _empty(rendered) if rendered.requires_grad else None
    values = torch.empty(2, dtype=torch.float64, device=rendered.device)
    call(losses.rgb_loss, _plain(rendered), _plain(target), dssim, values, gradient, queue)
    value = torch.lerp(*values, dssim).to(rendered.dtype)
    return value if gradient is None else with_gradients(value, [rendered], [gradient])


def normal_consistency(depth: Tensor, alpha: Tensor, normal: Tensor, K: Tensor, pose: Tensor) -> Tensor:
    """`surface.normal_consistency` of float32 maps on one device; alpha is held constant.

    Args:
        K: (3, 3) without skew, pixels; on the maps' device, or nothing waits for it to come.
        pose: (4, 4) cam_from_world, likewise.
    """
    losses, queue = _losses(depth)
    grad_depth, grad_normal = _empty(depth), _empty(normal)
    values = torch.empty(10, dtype=torch.float64, device=depth.device)
    call(
        losses.normal_consistency, *map(_plain, (depth, alpha, normal)), _there(K, depth), _there(pose, depth),
        grad_depth, grad_normal, values, queue,
    )  # fmt: skip
    inputs, gradients = [depth, normal], [grad_depth, grad_normal]
    if pose.requires_grad:
        grad_pose = pose.new_zeros(4, 4)
        grad_pose[:3, :3] = values[1:].reshape(3, 3)
        inputs, gradients = [*inputs, pose], [*gradients, grad_pose]
    return with_gradients(values[0].to(depth.dtype), inputs, gradients)


def depth_normals(depth: Tensor, K: Tensor, pose: Tensor) -> Tensor:
    """(H, W, 3) `geometry.depth_to_normals` of a float32 map; no gradient."""
    losses, queue = _losses(depth)
    normal = torch.empty(*depth.shape, 3, dtype=torch.float32, device=depth.device)
    call(losses.depth_normals, _plain(depth), _there(K, depth), _there(pose, depth), normal, queue)
    return normal


def depth_prior_loss(
    depth: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    *,
    space: str = "depth",
    align: bool = True,
    gradient_weight: float = 0.5,
    scales: int = LEVELS,
    confidence: Tensor | None = None,
) -> Tensor:
    """`depth_prior.depth_prior_loss` of float32 maps on one device, at up to `LEVELS` scales."""
    if confidence is not None:
        confidence = _plain(confidence)
    maps = (_plain(alpha), _plain(prior), _mask(valid), confidence)
    losses, queue = _losses(depth)
    gradient, levels = _empty(depth), scales if gradient_weight else 0
    value = torch.empty(1, dtype=torch.float64, device=depth.device)
    call(
        losses.depth_prior, _plain(depth), *maps, space == "disparity", align, gradient_weight, levels, gradient,
        value, queue,
    )  # fmt: skip
    return with_gradients(value[0].to(depth.dtype), [depth], [gradient])


def normal_prior_loss(
    normal: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    *,
    l1: float = 0.01,
    cosine: float = 0.01,
    confidence: Tensor | None = None,
    step: int = 1,
) -> Tensor:
    """`normal_prior.normal_prior_loss` of float32 maps on one device."""
    if confidence is not None:
        confidence = _plain(confidence)
    maps = (_plain(alpha), _plain(prior), _mask(valid), confidence)
    return _NormalPrior.apply(normal, *maps, l1, cosine, step)


class Other(NamedTuple):
    """The neighbour that pixels are compared with.

    Attributes:
        grey: (h, w) float32 of its photo.
        usable: (h, w) bool, pixels of the photo that may be compared; None: all.
        inverse_depth: of every `step`-th row and column, 1/m, 0 = none.
        K, pose: (3, 3) pixels without skew, (4, 4) cam_from_world.
    """

    grey: Tensor
    usable: Tensor | None
    inverse_depth: Tensor
    step: int
    K: Tensor
    pose: Tensor


def multiview(
    depth: Tensor,
    normal: Tensor | None,
    pixels: Tensor,
    grey: Tensor,
    K: Tensor,
    pose: Tensor,
    other: Other,
    patch: int,
) -> Tensor:
    """(2,) `multiview_geometric` and `multiview_photometric` of drawn pixels; differentiable in depth and normal.

    Args:
        depth: (H, W) rendered z-depth, metres, above 0 where a pixel is drawn.
        normal: (H, W, 3) rendered, world frame, of any length; None: the second value is 0.
        pixels: (M,) int32, row * W + column; below 0: none.
        grey: (H, W) of the photo, about 0..1.
        K, pose: of the view.
        patch: side, pixels, odd, 31 at most.

    Raises:
        TypeError, ValueError: tensors of other types and shapes, cameras or a patch that cannot be; on the CPU, where
            a look costs no wait, pixels outside of the image and levels far from 0..1.
    """
    _check_multiview(depth, normal, pixels, grey, K, pose, other, patch)
    other = other._replace(
        grey=_plain(other.grey),
        usable=None if other.usable is None else _plain(other.usable),
        inverse_depth=_plain(other.inverse_depth),
    )
    return _Multiview.apply(depth, normal, pixels.contiguous(), _plain(grey), K, pose, other, patch)


def _check_multiview(
    depth: Tensor,
    normal: Tensor | None,
    pixels: Tensor,
    grey: Tensor,
    K: Tensor,
    pose: Tensor,
    other: Other,
    patch: int,
) -> None:
    maps = {"depth": depth, "grey": grey, "the other's grey": other.grey, "inverse_depth": other.inverse_depth}
    check_images(**maps)
    step = check_step(other.step)
    if grey.shape != depth.shape or other.inverse_depth.shape != tuple(-(-side // step) for side in other.grey.shape):
        raise ValueError("depth and photos differ in size")
    if normal is not None:
        check_tensor("normal", normal, (*depth.shape, 3))
        check_same_device(depth=depth, normal=normal)
    if any(x.dtype != torch.float32 for x in (*maps.values(), *([] if normal is None else [normal]))):
        raise TypeError("maps and photos are to be of float32")
    if other.usable is not None:
        check_mask("usable", other.usable)
        check_same_device(depth=depth, usable=other.usable)
        if other.usable.shape != other.grey.shape:
            raise ValueError("usable and the other's photo differ in size")
    check_intrinsics(**{"K": K, "the other's K": other.K})
    check_pose("pose", pose)
    check_pose("the other's pose", other.pose)
    if whole_number("patch", patch, 1) > MOST_SAMPLES or patch % 2 == 0:
        raise ValueError(f"patch is {patch}; it is to be odd and {MOST_SAMPLES} at most")
    if not isinstance(pixels, Tensor) or pixels.dtype != torch.int32 or pixels.ndim != 1:
        raise TypeError("pixels are no tensor (M,) of int32")
    check_same_device(depth=depth, pixels=pixels)
    if depth.device.type == "cpu":
        if len(pixels) and pixels.max().item() >= depth.numel():
            raise ValueError(f"pixels name {pixels.max().item()}, but the image has {depth.numel()}, counted from 0")
        check_grey(**{"grey": grey, "the other's grey": other.grey})


def _losses(like: Tensor):
    """The kernels with their buffers, and the queue to use them on."""
    _plain(like)
    build = build_for(like) or PLAIN
    queue = build.queue(like)
    if like.is_cuda:
        return _held(build, like.device.index, queue), queue
    return build.extension.BlockLosses(), queue


@cache
def _held(build, device: int, queue: int):
    """One for each stream: what runs on it comes one after another, and may use the same buffers."""
    return build.extension.BlockLosses()


def _plain(x: Tensor) -> Tensor:
    """Sizes and types of maps are the kernels' to refuse."""
    if not isinstance(x, Tensor):
        raise TypeError(f"maps are to be torch.Tensors, not of the type {type(x).__name__}")
    return x.detach().contiguous()


def _mask(valid: Tensor) -> Tensor:
    valid = _plain(valid)
    if valid.dtype != torch.bool:
        raise TypeError(f"valid is of {valid.dtype}, not bool")
    return valid.view(torch.uint8)


def _there(camera: Tensor, like: Tensor) -> Tensor:
    if not isinstance(camera, Tensor) or not camera.dtype.is_floating_point:
        raise TypeError("cameras are to be torch.Tensors in floating point")
    return camera.detach().to(like.device, torch.float32).contiguous()


def _empty(x: Tensor) -> Tensor:
    return torch.empty_like(x, memory_format=torch.contiguous_format)


class _NormalPrior(torch.autograd.Function):
    @staticmethod
    def forward(ctx, normal, alpha, prior, valid, confidence, l1, cosine, step) -> Tensor:
        losses, queue = _losses(normal)
        gradient = _empty(normal)
        values = torch.empty(2, dtype=torch.float64, device=normal.device)
        maps = (_plain(normal), alpha, prior, valid, confidence)
        call(losses.normal_prior, *maps, l1, cosine, step, gradient, values, queue)
        value, share = values.to(normal.dtype)
        ctx.save_for_backward(gradient, share)
        return value

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad: Tensor):
        gradient, share = ctx.saved_tensors
        return gradient.mul_(grad * share), *[None] * 7  # in place: torch refuses a second backward through this node


class _Multiview(torch.autograd.Function):
    @staticmethod
    def forward(ctx, depth, normal, pixels, grey, K, pose, other: Other, patch: int) -> Tensor:
        losses, queue = _losses(depth)
        to_depth, to_normal = (depth.new_empty(len(pixels), n) for n in (2, 3))
        values = torch.empty(4, dtype=torch.float64, device=depth.device)
        call(
            losses.multiview, _plain(depth), None if normal is None else _plain(normal), pixels, grey, other.grey,
            None if other.usable is None else other.usable.view(torch.uint8), other.inverse_depth, other.step,
            *(_there(x, depth) for x in (K, pose, other.K, other.pose)), patch, to_depth, to_normal, values, queue,
        )  # fmt: skip
        ctx.save_for_backward(pixels, to_depth, to_normal, values[2:])
        ctx.shapes = depth.shape, None if normal is None else normal.shape
        return values[:2].to(depth.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad: Tensor):
        pixels, to_depth, to_normal, counts = ctx.saved_tensors
        share = grad / counts.to(grad.dtype)
        # a pixel may be drawn twice; added up in one order, and not by atomics. What is below 0 has no gradient.
        where = (pixels.clamp(min=0).long(),)
        depth, normal = ctx.shapes
        by_depth = to_depth.new_zeros(depth.numel()).index_put_(where, to_depth @ share, accumulate=True).view(depth)
        if normal is None:
            return by_depth, *[None] * 7
        by_normal = to_normal.new_zeros(depth.numel(), 3).index_put_(where, to_normal * share[1], accumulate=True)
        return by_depth, by_normal.view(normal), *[None] * 6
