"""The compiled kernels as a backend: float32 on the CPU."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.cores import available_cores
from room2dgs.splat.backends import cpu_view
from room2dgs.splat.backends.backend import Backend, View
from room2dgs.splat.backends.operators import rasterize
from room2dgs.splat.types import Rendering, Surfels

FLOATS = (torch.float32,)  # what compiled kernels take


def set_threads(count: int | None = None) -> int:
    """Threads of the compiled kernels from now on; None: every core that this process may use.

    The results are the same bits for any number.

    Returns:
        The number in use.
    """
    _C.set_threads(count or available_cores())
    return _C.threads()


set_threads()


class _Rasterize(torch.autograd.Function):
    """What the operator does, without the dispatcher's way through Python, which costs a small view's own time."""

    @staticmethod
    def forward(ctx, *inputs):  # a setup_context of its own would have torch inspect signatures at every call
        output = cpu_view.forward(*inputs)
        cpu_view.keep_for_backward(ctx, inputs, output)
        return output

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, *to_outputs):
        return cpu_view.gradients(ctx, to_outputs, cpu_view.backward)


def _render(surfels: Surfels, view: View) -> Rendering:
    tensors = (*surfels, view.cam_from_world, view.K, view.background)
    # anything that traces or wraps needs the operator
    plain = not torch.compiler.is_compiling() and all(type(x) in (Tensor, torch.nn.Parameter) for x in tensors)
    *images, _ = (_Rasterize.apply if plain else rasterize)(
        *tensors, view.center_px, view.width, view.height, view.near_m, view.opacity_floor, view.with_normal,
        view.with_distortion,
    )  # fmt: skip
    return Rendering(*images)


BACKEND = Backend("cpu", ("cpu",), FLOATS, _render)
