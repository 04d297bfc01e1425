"""Rendering by a named backend, for callers whose tensors are on the CPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from room2dgs import splat
from room2dgs.errors import InputError
from room2dgs.splat.types import Rendering

DEVICES = ("cpu", "cuda")


def device_of(backend: str) -> str:
    """The device type that a backend renders on: they have the devices' names.

    Raises:
        InputError: no such backend, or torch does not reach its device.
    """
    if backend not in DEVICES:
        raise InputError(f"no rasterizer is called {backend!r}; choose from {', '.join(DEVICES)} (see room2dgs doctor)")
    if backend == "cuda" and not torch.cuda.is_available():
        raise InputError(
            f"the rasterizer {backend!r} needs a GPU that torch reaches: room2dgs doctor says what is missing"
        )
    return backend


def renderer(backend: str, by: Callable[..., Rendering] = splat.render) -> Callable[..., Rendering]:
    """`by` on a backend, wherever it works: tensors go there and images come back, gradients likewise.

    Args:
        by: with the arguments of `splat.render`.
    """
    device = device_of(backend)

    def render(splats: Any, K: Tensor, cam_from_world: Tensor, width: int, height: int, **options) -> Rendering:
        moved = type(splats)(*(x.to(device) for x in splats))
        options = {name: x.to(device) if isinstance(x, Tensor) else x for name, x in options.items()}
        images = by(moved, K.to(device), cam_from_world.to(device), width, height, **options)
        return Rendering(*(x.cpu() for x in images))

    return by if device == "cpu" else render
