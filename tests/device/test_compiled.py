"""The CUDA kernels compile, and stay within what they may use of a multiprocessor. Needs nvcc, not a GPU."""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

HERE = Path(__file__).parent
spec = importlib.util.spec_from_file_location("compiled", HERE / "compiled.py")
compiled = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compiled)

pytestmark = pytest.mark.skipif(shutil.which("nvcc") is None, reason="no nvcc")


class Limit(NamedTuple):
    """At most so many registers and bytes of shared memory, with blocks of so many threads; nothing spilled."""

    threads: int
    registers: int
    shared: int
    occupancy: float  # at least so much of an H100


LIMITS: dict[str, Limit] = {}


def test_the_primitive_is_cheap(tmp_path):
    """20 sums over a block need no memory but the numbers themselves; barriers and votes none at all."""
    found = compiled.usage([HERE / "block_check.cu"], tmp_path)
    assert set(found) == {"SumKernel", "TurnKernel", "VoteKernel"}
    assert all(use.spilled == 0 and use.stack == 0 for use in found.values()), found
    assert found["SumKernel"].registers <= 40 and found["SumKernel"].shared == 400
    assert found["VoteKernel"].shared == 0


@pytest.mark.slow
def test_every_kernel_is_within_its_limits(tmp_path):
    found = compiled.usage(compiled.sources(), tmp_path)
    assert set(found) == set(LIMITS)
    for name, limit in LIMITS.items():
        use = found[name]
        assert use.spilled == 0, (name, use)
        assert use.registers <= limit.registers and use.shared <= limit.shared, (name, use)
        assert use.occupancy(limit.threads) >= limit.occupancy, (name, use, use.occupancy(limit.threads))
