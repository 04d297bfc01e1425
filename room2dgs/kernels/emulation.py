"""A GPU's kernels in another device's place, for tests: what runs on a GPU is checked where there is none."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial

import torch

from room2dgs.kernels.builds import BLOCK_BUILDS, PLAIN, Build
from room2dgs.kernels.operators import BY_BLOCK_CODE, NAMESPACE

DISPATCH_KEYS = {"cpu": "CPU", "meta": "Meta"}


@contextmanager
def block_code_on(device_type: str, build: Build) -> Iterator[None]:
    """Until the block ends a build of block code is used for a type of device, and the loops treat it as a GPU.

    Operators that are defined by then are replaced: import `room2dgs.splat` and `room2dgs.losses` first.
    """
    before = BLOCK_BUILDS.get(device_type)
    with torch.library._scoped_library(NAMESPACE, "IMPL") as library:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that kernels are replaced, which is the purpose
            for name, by_block_code in BY_BLOCK_CODE.items():
                library.impl(name, partial(by_block_code, build), DISPATCH_KEYS[device_type])
        BLOCK_BUILDS[device_type] = build
        try:
            yield
        finally:
            del BLOCK_BUILDS[device_type]
            if before is not None:
                BLOCK_BUILDS[device_type] = before


def cuda_kernels_on_cpu() -> AbstractContextManager[None]:
    """Until the block ends the CPU's tensors, stereo and fusion run the CUDA kernels, compiled as plain C++."""
    return block_code_on("cpu", PLAIN)
