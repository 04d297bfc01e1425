"""Tensors handed to compiled kernels without a detour: several dozen calls' arguments are an iteration's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from torch import Tensor
from torch.utils.dlpack import to_dlpack


def call(kernel: Callable[..., Any], *args: Any, **more: Any) -> Any:
    """`kernel(*args, **more)`, whose tensors share their memory with it.

    A tensor itself would be asked for it by `__dlpack__`, which is Python: 7 to 14 us each instead of 1. What kernels
    do, autograd does not see.
    """
    return kernel(*map(_handed, args), **more)


def _handed(value: Any) -> Any:
    return to_dlpack(value) if isinstance(value, Tensor) and not value.is_meta else value
