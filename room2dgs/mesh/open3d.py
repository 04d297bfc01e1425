"""open3d, imported without dash: pages served from Python are not used here, and dash takes 1.3 s and 40 MB."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any


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
    dash.html, dash.dcc = _Later("dash.html"), _Later("dash.dcc")
    dash.Dash = lambda *args, **more: import_module("dash").Dash(*args, **more)
    sys.modules["dash"] = dash
    try:
        yield
    finally:
        del sys.modules["dash"]


with _dash_later():
    import open3d as o3d
    import open3d.core as o3c

__all__ = ["o3c", "o3d"]
