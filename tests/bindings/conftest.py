"""The extension under test: the installed one, or the build with sanitizers that ROOM2DGS_EXTENSION names."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # binding_calls, which several files here use


def _load(path: str) -> None:
    spec = importlib.util.spec_from_file_location("room2dgs._C", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["room2dgs._C"] = module
    spec.loader.exec_module(module)


if os.environ.get("ROOM2DGS_EXTENSION"):
    import room2dgs

    _load(os.environ["ROOM2DGS_EXTENSION"])
    room2dgs._C = sys.modules["room2dgs._C"]


@pytest.fixture(autouse=True)
def threads():
    """The number of threads is as it was after each test."""
    from room2dgs import _C

    before = _C.threads()
    yield
    _C.set_threads(before)
