"""open3d, imported without dash: pages served from Python are not used here, and dash takes 1.3 s and 40 MB."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np


class _Later(ModuleType):
    """Stands for a module until something of it is asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(import_module(self.__name__), name)


@contextmanager
def _dash_later() -> Iterator[None]:
    if "dash" in sys.modules:
        yield
        return
    dash = ModuleType("dash")
    later = {
        "html": _Later("dash.html"),
        "dcc": _Later("dash.dcc"),
        "Dash": lambda *args, **more: import_module("dash").Dash(*args, **more),
    }
    dash.__dict__.update(later)
    sys.modules["dash"] = dash
    try:
        yield
    finally:
        del sys.modules["dash"]


with _dash_later():
    import open3d as o3d
    import open3d.core as o3c

__all__ = ["o3c", "o3c_tensor", "o3d"]


def o3c_tensor(values: np.ndarray) -> o3c.Tensor:
    """A copy of an array."""
    return o3c.Tensor(values)  # type: ignore[call-overload]  # its stubs know no defaults
