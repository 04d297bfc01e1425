"""The fused losses by the kernels written for CUDA: on a GPU's tensors, or as plain C++ on the CPU's, for tests.

What they compute is `photometric.rgb_loss` and `surface.normal_consistency`, with the arithmetic of the CPU's kernels.
Nothing waits for the device: values are tensors there.
"""

from __future__ import annotations

import importlib
from functools import cache
from types import ModuleType

import torch
from torch import Tensor

from room2dgs import _C


@cache
def cuda_kernels() -> ModuleType | None:
    """The extension `_cuda`, or None where it was not built."""
    try:
        return importlib.import_module("room2dgs._cuda")
    except ImportError:
        return None


def runs_on_cuda(*maps: Tensor) -> bool:
    """True if CUDA's kernels are there for these tensors."""
    return all(m.is_cuda and m.dtype == torch.float32 for m in maps) and cuda_kernels() is not None


def rgb_loss(rendered: Tensor, target: Tensor, dssim: float, order: int = 0) -> Tensor:
    """`photometric.rgb_loss` of float32 images on one device; differentiable once with respect to `rendered`.

    Args:
        order: on the CPU, which order of blocks and threads to draw; the result does not depend on it.
    """
    return _RgbLoss.apply(rendered, target, dssim, order)


def normal_consistency(
    depth: Tensor,
    alpha: Tensor,
    normal: Tensor,
    pinhole: tuple[float, float, float, float],
    pose: Tensor,
    order: int = 0,
) -> Tensor:
    """`surface.normal_consistency` of float32 maps on one device; alpha is held constant.

    Args:
        pinhole: fx, fy, cx, cy, pixels.
        pose: (4, 4) cam_from_world; best on the CPU, since the kernels take it from there.
        order: as in `rgb_loss`.
    """
    return _NormalConsistency.apply(depth, alpha, normal, pinhole, pose, order)


def depth_normals(depth: Tensor, pinhole: tuple[float, float, float, float], pose: Tensor, order: int = 0) -> Tensor:
    """(H, W, 3) `geometry.depth_to_normals` of a float32 map; no gradient."""
    losses, queue = _losses(depth, order)
    normal = torch.empty(*depth.shape, 3, dtype=torch.float32, device=depth.device)
    losses.depth_normals(depth.detach().contiguous(), *pinhole, _rotation(pose), normal, queue)
    return normal


def _losses(like: Tensor, order: int):
    """The kernels with their buffers, and the queue to use them on."""
    if not like.is_cuda:
        return _C.device.BlockLosses(), order
    queue = torch.cuda.current_stream(like.device).cuda_stream
    return _held(like.device.index, queue), queue


@cache
def _held(device: int, queue: int):
    """One for each stream: what runs on it comes one after another, and may use the same buffers."""
    return cuda_kernels().BlockLosses()


def _rotation(pose: Tensor):
    return pose.detach()[:3, :3].to("cpu", torch.float64).contiguous()


class _RgbLoss(torch.autograd.Function):
    @staticmethod
    def forward(ctx, rendered: Tensor, target: Tensor, dssim: float, order: int) -> Tensor:
        losses, queue = _losses(rendered, order)
        gradient = (
            torch.empty_like(rendered, memory_format=torch.contiguous_format) if ctx.needs_input_grad[0] else None
        )
        values = torch.empty(2, dtype=torch.float64, device=rendered.device)
        losses.rgb_loss(
            rendered.detach().contiguous(), target.detach().contiguous(), dssim, values, gradient, queue
        )  # fmt: skip
        if gradient is not None:
            ctx.save_for_backward(gradient)
        return ((1 - dssim) * values[0] + dssim * values[1]).to(rendered.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad: Tensor):
        (gradient,) = ctx.saved_tensors
        return gradient.mul_(grad), None, None, None  # in place: torch refuses a second backward through this node


class _NormalConsistency(torch.autograd.Function):
    @staticmethod
    def forward(ctx, depth: Tensor, alpha: Tensor, normal: Tensor, pinhole, pose: Tensor, order: int) -> Tensor:
        losses, queue = _losses(depth, order)
        grad_depth, grad_normal = (torch.empty_like(x, memory_format=torch.contiguous_format) for x in (depth, normal))
        values = torch.empty(10, dtype=torch.float64, device=depth.device)
        losses.normal_consistency(
            *(x.detach().contiguous() for x in (depth, alpha, normal)),
            *pinhole, _rotation(pose), grad_depth, grad_normal, values, queue,
        )  # fmt: skip
        grad_pose = torch.zeros(4, 4, dtype=torch.float64, device=depth.device)
        grad_pose[:3, :3] = values[1:].reshape(3, 3)
        ctx.save_for_backward(grad_depth, grad_normal, grad_pose.to(pose))
        return values[0].to(depth.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad: Tensor):
        # in place: torch refuses a second backward through this node
        grad_depth, grad_normal, grad_pose = (gradient.mul_(grad.to(gradient.device)) for gradient in ctx.saved_tensors)
        return grad_depth, None, grad_normal, None, grad_pose, None
