"""Memory that a stage has freed."""

from __future__ import annotations

import platform
from pathlib import Path

import numpy as np
import pytest

from room2dgs.runs.metrics import Stages, timed


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc keeps it")
def test_what_a_stage_frees_between_what_stays_is_given_back():
    """Blocks too small to be mapped on their own, and every hundredth of them stays in use: the heap cannot shrink."""
    with timed(Stages(), "first"):
        pass
    before = resident_mb()
    with timed(Stages(), "second"):
        blocks = [np.ones(8192) for _ in range(4000)]  # 64 KiB each
        most = resident_mb()
        stays = blocks[::100]
        del blocks
    assert most - before > 200
    assert resident_mb() - before < 0.3 * (most - before)
    assert len(stays) == 40
