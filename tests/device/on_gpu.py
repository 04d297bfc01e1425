"""Tests of block code on a GPU: `python -m pytest -p tests.device.on_gpu` and their files; `make gpu-check` does so.

`_cuda` takes the place of `_C.device`: what a test gives it is copied to the GPU and back. The order of blocks and
threads is the GPU's own there, and another queue is another stream.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch.utils.dlpack import from_dlpack

from room2dgs import _C, _cuda

CAMERA = ("K", "local_from_cam", "pixel_from_voxel")  # of fusion, whose numbers the host reads
STREAMS: dict[int, torch.cuda.Stream] = {}


def _stream(order: int) -> int:
    if order == 0:
        return torch.cuda.default_stream().cuda_stream
    return STREAMS.setdefault(order, torch.cuda.Stream()).cuda_stream


def _tensor(value: Any) -> torch.Tensor | None:
    """On the same memory; None for what is no array."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value)
    if type(value).__name__ == "PyCapsule":  # what `kernels.calls.call` gives
        return from_dlpack(value)
    return value if isinstance(value, torch.Tensor) else None


def _moving(function: Callable[..., Any], stays: tuple[str, ...] = ()) -> Callable[..., Any]:
    """The function, for arrays that lie on the host; those named in `stays` it wants there."""
    signature = function.__doc__.splitlines()[0]  # nanobind writes it
    names = re.findall(r"(\w+): ", signature)
    if "device='cpu'" in signature:
        stays = tuple(names)

    def call(*args: Any, **more: Any) -> Any:
        if len(args) > len(names):
            raise TypeError("too many arguments")
        given = dict(zip(names, args, strict=False)) | more
        if "queue" in names:
            given["queue"] = _stream(given.get("queue", 0))
        moved: dict[int, tuple[torch.Tensor, torch.Tensor]] = {}
        for name, value in given.items():
            here = _tensor(value)
            if here is not None and name not in stays:
                given[name] = moved.setdefault(id(value), (here, here.cuda()))[1]
        torch.cuda.synchronize()
        result = function(**given)
        torch.cuda.synchronize()
        for here, there in moved.values():
            here.detach().numpy()[...] = there.cpu().numpy()  # autograd must not take it for a change
        return result

    return call


def _class(kind: type) -> type:
    """One whose methods take what lies on the host."""

    class Moving:
        def __init__(self, *args: Any) -> None:
            self._object = kind(*args)

        def __getattr__(self, name: str) -> Any:
            found = getattr(self._object, name)
            return _moving(found) if callable(found) else found

    return Moving


for _name in ("BlockFrame", "GaussianBlockFrame", "BlockLosses", "PatchMatch"):
    setattr(_C.device, _name, _class(getattr(_cuda, _name)))
for _name in ("touched_blocks", "fuse_depth"):
    setattr(_C.device, _name, _moving(getattr(_cuda, _name), CAMERA))
_C.device.StereoPhoto = _cuda.StereoPhoto
os.environ["ROOM2DGS_BLOCK_ISA"] = "avx2"  # its fused multiply-adds are a GPU's, too
