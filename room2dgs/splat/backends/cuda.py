"""The CUDA kernels as a backend: float32 on an NVIDIA GPU, where the extension `_cuda` was built (docs/cuda.md)."""

from __future__ import annotations

from functools import partial

import torch
from torch import Tensor

from room2dgs.block_code import CUDA
from room2dgs.cuda_extension import cuda_extension
from room2dgs.splat.backends import block_view
from room2dgs.splat.backends.backend import Backend, View
from room2dgs.splat.backends.cpu import FLOATS
from room2dgs.splat.backends.operators import rasterize, rasterize_backward
from room2dgs.splat.types import Rendering, Surfels

if CUDA is not None:
    rasterize.register_kernel("cuda", partial(block_view.forward, CUDA))
    rasterize_backward.register_kernel("cuda", partial(block_view.backward, CUDA))


def _render(surfels: Surfels, view: View) -> Rendering:
    inputs = (
        *surfels, view.cam_from_world, view.K, view.background, view.center_px,
        view.width, view.height, view.near_m, view.opacity_floor, view.with_normal, view.with_distortion,
    )  # fmt: skip
    tensors = inputs[:8]
    # anything that traces or wraps needs the operator
    plain = not torch.compiler.is_compiling() and all(type(x) in (Tensor, torch.nn.Parameter) for x in tensors)
    *images, _ = block_view.Rasterize.apply(*inputs, CUDA) if plain else rasterize(*inputs)
    return Rendering(*images)


BACKEND = Backend("cuda", ("cuda",), FLOATS, _render, missing=cuda_extension().missing)
