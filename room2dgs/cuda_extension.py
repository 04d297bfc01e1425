"""The extension `_cuda`, or the reason why it cannot be loaded."""

from __future__ import annotations

import importlib
from functools import cache
from types import ModuleType
from typing import NamedTuple

from room2dgs.errors import first_line

NAME = "room2dgs._cuda"
BUILD = "pip install . -C cmake.define.ROOM2DGS_CUDA=on"


class Extension(NamedTuple):
    """What came of loading it.

    Attributes:
        module: None where it cannot be used.
        built: it is there, loaded or not.
        reason: why it cannot be used, as the loader says it; empty where it can.
    """

    module: ModuleType | None
    built: bool
    reason: str

    @property
    def missing(self) -> str | None:
        """Why nothing runs on a GPU, and what to do; None where it can."""
        if self.module is not None:
            return None
        if not self.built:
            return (
                f"this room2dgs was built without CUDA: build it with `{BUILD}` where there is an nvcc "
                "(docs/how-to/gpu.md), or move the tensors to the CPU"
            )
        return (
            f"room2dgs's CUDA kernels are built, but cannot be loaded ({self.reason}): mend that, build them again "
            f"with `{BUILD}` (docs/how-to/gpu.md), or move the tensors to the CPU"
        )


@cache
def cuda_extension() -> Extension:
    """Loaded when first asked for."""
    try:
        return Extension(importlib.import_module(NAME), True, "")
    except ModuleNotFoundError as error:
        # one that it needs itself may be what is not there
        return Extension(None, error.name != NAME, first_line(error))
    except ImportError as error:
        return Extension(None, True, first_line(error))
