"""Rasterizers by name. A new one is a new file here and a line in `BACKENDS`."""

from __future__ import annotations

from torch import Tensor

from room2dgs.block_code import BUILDS
from room2dgs.splat.backends import blocks, cpu, cuda, torch_reference
from room2dgs.splat.backends.backend import Backend, View

BACKENDS: dict[str, Backend] = {b.name: b for b in (cpu.BACKEND, cuda.BACKEND, torch_reference.BACKEND, blocks.BACKEND)}

__all__ = ["BACKENDS", "Backend", "View", "backend_for"]


def backend_for(like: Tensor, name: str | None = None) -> Backend:
    """The backend of that name, or, without one, the automatic one of the tensor's device.

    Raises:
        ValueError: no such backend, or it does not take tensors of this type on this device, or is not in this build.
    """
    device, dtype = like.device.type, like.dtype
    if name is None and device != "cuda" and device in BUILDS:  # see `block_code.plain_code`
        return blocks.BACKEND
    if name is None:
        found = [b for b in BACKENDS.values() if b.automatic and (b.devices is None or device in b.devices)]
        if not found:
            raise ValueError(f"no rasterizer for tensors on {device}; move them to the CPU")
        backend = found[0]
    elif name in BACKENDS:
        backend = BACKENDS[name]
    else:
        raise ValueError(f"no rasterizer is called {name!r}; there are {', '.join(BACKENDS)}")
    if backend.devices is not None and device not in backend.devices:
        raise ValueError(f"the rasterizer {backend.name!r} works on {', '.join(backend.devices)}, not on {device}")
    if backend.missing is not None:
        raise ValueError(backend.missing)
    if backend.dtypes is not None and dtype not in backend.dtypes:
        raise ValueError(
            f"the surfels are {dtype}; the rasterizer {backend.name!r} takes "
            f"{', '.join(map(str, backend.dtypes))} (the backend 'reference' takes any)"
        )
    return backend
