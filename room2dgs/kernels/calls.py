"""Tensors handed to compiled kernels without a detour: an iteration makes several dozen such arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from torch import Tensor
from torch.utils.dlpack import to_dlpack


def call(kernel: Callable[..., Any], *args: Any, **more: Any) -> Any:
    """`kernel(*args, **more)`, whose tensors share their memory with it.

    Given a tensor, nanobind would call its `__dlpack__`, which is Python: 7 to 14 us each instead of 1. Autograd does
    not see what kernels do.
    """
    return kernel(*map(_as_capsule, args), **more)


def _as_capsule(value: Any) -> Any:
    return to_dlpack(value) if isinstance(value, Tensor) and not value.is_meta else value
