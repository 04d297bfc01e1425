"""Operators of torch, `torch.ops.room2dgs`: torch's dispatcher chooses the kernels by the tensors' device.

`Library.impl` adds 2 to 4 us to a call; `torch.library.custom_op` would add 10 to 50, as much as a small kernel takes.
Operators know nothing of gradients: forward and backward pass are operators of their own, around which a
`torch.autograd.Function` stands.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import torch
from torch import Tensor

from room2dgs.kernels.builds import BLOCK_BUILDS, CUDA, PLAIN

NAMESPACE = "room2dgs"
LIBRARY = torch.library.Library(NAMESPACE, "DEF")
BY_BLOCK_CODE: dict[str, Callable[..., Any]] = {}  # each operator's implementation of a `Build` and its arguments


def operator(schema: str, by_block_code: Callable[..., Any], on_cpu: Callable[..., Any] | None = None) -> Any:
    """Define an operator and register its kernels for the CPU and, where they were built, for CUDA.

    Args:
        schema: its name, arguments and results, as torch writes them.
        by_block_code: `by_block_code(build, *arguments)` by the kernels written for CUDA; tensors are on the build's
            device.
        on_cpu: `on_cpu(*arguments)` by the CPU's own kernels; None: the CPU runs block code as plain C++.

    Returns:
        what calls it.
    """
    name = schema.partition("(")[0]
    LIBRARY.define(schema)
    BY_BLOCK_CODE[name] = by_block_code
    LIBRARY.impl(name, torch.library.fallthrough_kernel, "Autograd")  # no gradients, and no warnings of that
    LIBRARY.impl(name, on_cpu or partial(by_block_code, PLAIN), "CPU")
    if CUDA is not None:
        LIBRARY.impl(name, partial(by_block_code, CUDA), "CUDA")
    return getattr(getattr(torch.ops, NAMESPACE), name).default


def has_kernels(*maps: Tensor) -> bool:
    """Whether compiled kernels work on these tensors: all float32, on one device that kernels were built for."""
    device = maps[0].device
    if device.type != "cpu" and device.type not in BLOCK_BUILDS:
        return False
    return all(m.dtype == torch.float32 and m.device == device for m in maps)
