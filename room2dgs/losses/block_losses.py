"""What the losses' implementations by block code (`kernels.operators`) have in common: kernels, buffers, arguments.

Nothing waits for the device: values are tensors there, and cameras are read there.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import torch
from torch import Tensor

from room2dgs.kernels.builds import Build


def losses_of(build: Build, like: Tensor) -> tuple[Any, int]:
    """The kernels with their buffers, and the queue to use them on."""
    queue = build.queue(like)
    if like.is_cuda:
        return _losses_of_stream(build, like.device.index, queue), queue
    return build.extension.BlockLosses(), queue


@cache
def _losses_of_stream(build: Build, device: int, queue: int) -> Any:
    """One for each stream: what runs on it comes one after another, and may use the same buffers."""
    return build.extension.BlockLosses()


def plain(values: Tensor) -> Tensor:
    """Without a gradient, contiguous."""
    return values.detach().contiguous()


def plain_or_none(values: Tensor | None) -> Tensor | None:
    """`plain`, bool as uint8 and other types as float32; None stays None."""
    if values is None:
        return None
    return plain(values).view(torch.uint8) if values.dtype == torch.bool else plain(values).float()


def camera_on(camera: Tensor, like: Tensor) -> Tensor:
    """A camera's matrix as the kernels read it: float32 on the maps' device."""
    return camera.detach().to(like.device, torch.float32).contiguous()


def empty_like(values: Tensor) -> Tensor:
    """Room for a gradient."""
    return torch.empty_like(values, memory_format=torch.contiguous_format)


def empty_sums(like: Tensor, count: int) -> Tensor:
    """Room for the float64 values of a loss, on the device of a map."""
    return torch.empty(count, dtype=torch.float64, device=like.device)
