"""Block code's builds (csrc/block.h), and which of them works on a tensor.

On a GPU that is the extension `_cuda`, where it was built. On the CPU none does by itself: there the same source is
plain C++, for tests, and works while `plain_code` says so.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs import _C


class Build(NamedTuple):
    """Block code, compiled for one kind of device.

    Attributes:
        extension: `_C.device` or `_cuda`.
        queue: where the work on a tensor's device goes, as the extension's functions take it.
    """

    extension: Any
    queue: Callable[[Tensor], int]


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
    try:
        extension = importlib.import_module("room2dgs._cuda")
    except ImportError:  # built without
        return None
    return Build(extension, lambda like: torch.cuda.current_stream(like.device).cuda_stream)


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
