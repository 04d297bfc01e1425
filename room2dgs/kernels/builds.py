"""Builds of the compiled kernels: the CPU's own, and block code (csrc/block.h), which is written for CUDA.

Block code is compiled twice: for GPUs as the extension `_cuda`, where there was a CUDA compiler, and as plain C++ for
the CPU. There the multi-view losses use it; everything else does so in tests alone (`kernels.emulation`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from room2dgs import _C, cuda_state
from room2dgs.cuda_extension import cuda_extension
from room2dgs.errors import InputError

if TYPE_CHECKING:  # fusion needs builds, and torch takes seconds to import
    from torch import Tensor


class Build(NamedTuple):
    """Kernels compiled for one kind of device.

    Attributes:
        extension: `_C`, `_C.device` or `_cuda`.
        queue: where the work on a tensor's device goes, as the extension's functions take it; without a tensor, on the
            current device.
    """

    extension: Any
    queue: Callable[[Tensor | None], int]


_order = 0


def set_order(seed: int) -> int:
    """Set the order in which plain C++ runs blocks and threads: 0 as they are numbered, otherwise drawn from the seed.

    No bit may depend on it.

    Returns:
        The seed before.
    """
    global _order
    before, _order = _order, seed
    return before


def _cuda() -> Build | None:
    extension = cuda_extension().module
    if extension is None:
        return None
    return Build(extension, _current_stream)


def _current_stream(like: Tensor | None) -> int:
    import torch

    return torch.cuda.current_stream(None if like is None else like.device).cuda_stream


CPU = Build(_C, lambda like: 0)  # the CPU's own kernels, where those have the names of block code's
PLAIN = Build(_C.device, lambda like: _order)  # block code as plain C++
CUDA = _cuda()
BLOCK_BUILDS: dict[str, Build] = {"cuda": CUDA} if CUDA else {}  # types of device that run block code -> its build


def is_asynchronous(numbers: Tensor) -> bool:
    """Whether reading a number's value would wait for its device, as on a GPU."""
    return numbers.device.type in BLOCK_BUILDS


def build_of(device: str) -> Build:
    """The kernels that `render.device` names, for what is not a tensor.

    Raises:
        InputError: no GPU, or nothing that runs on it.
    """
    if device == "cuda" and (lacking := cuda_state.missing()):
        raise InputError(
            f"render.device=cuda lacks {', '.join(lacking)}; give render.device=cpu (room2dgs doctor says more)"
        )
    return BLOCK_BUILDS.get(device, CPU)
