"""Block code's builds (csrc/block.h), and which of them works on a tensor.

On a GPU that is the extension `_cuda`, where it was built. On the CPU none does by itself: there the same source is
plain C++, which works while `plain_code` says so, for tests. The multi-view terms alone take it without being told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs import _C, cuda_state
from room2dgs.cuda_extension import cuda_extension
from room2dgs.errors import InputError


class Build(NamedTuple):
    """Block code, compiled for one kind of device.

    Attributes:
        extension: `_C.device` or `_cuda`.
        queue: where the work on a tensor's device goes, as the extension's functions take it; without one, on the
            current device.
    """

    extension: Any
    queue: Callable[[Tensor | None], int]


_order = 0


def set_order(seed: int) -> int:
    """In which order plain C++'s blocks and threads come from now on: 0 as they are numbered, else drawn.

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
    return Build(extension, lambda like: torch.cuda.current_stream(None if like is None else like.device).cuda_stream)


CPU = Build(_C, lambda like: 0)  # the CPU's own kernels, where those have the names of block code's
PLAIN = Build(_C.device, lambda like: _order)
CUDA = _cuda()
BUILDS: dict[str, Build] = {"cuda": CUDA} if CUDA else {}  # that work by themselves, by type of device


@contextmanager
def plain_code() -> Iterator[None]:
    """The CPU's tensors are block code's until the block ends, wherever it and the CPU's own kernels do the same."""
    before = BUILDS.get("cpu")
    BUILDS["cpu"] = PLAIN
    try:
        yield
    finally:
        BUILDS.pop("cpu")
        if before:
            BUILDS["cpu"] = before


def build_for(*maps: Tensor) -> Build | None:
    """The build that takes these tensors: all float32, on one device; None: block code is not for them."""
    device = maps[0].device
    fits = all(m.dtype == torch.float32 and m.device == device for m in maps)
    return BUILDS.get(device.type) if fits else None


def stays(numbers: Tensor) -> bool:
    """Whether a number stays on its device until somebody asks: where block code works, a look at it is a wait."""
    return numbers.device.type in BUILDS


def build_of(device: str) -> Build:
    """The kernels that `render.device` names, for what is no tensor: the CPU's own, CUDA's, or block code's plain C++.

    Raises:
        InputError: no GPU, or nothing that runs on it.
    """
    if device == "cuda" and (lacking := cuda_state.missing()):
        raise InputError(
            f"render.device=cuda lacks {', '.join(lacking)}; give render.device=cpu (room2dgs doctor says more)"
        )
    return {"cpu": CPU, "blocks": PLAIN, "cuda": CUDA}[device]
