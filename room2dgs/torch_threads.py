"""Keeps torch to one thread while training runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Torch computes on one thread inside; the kernels keep theirs.

    Torch cuts elementwise work of more than 32768 numbers by its number of threads, and sigmoid rounds
    the last few of a piece (scalar code) otherwise than the rest (vector code): the bits of a run would
    depend on the threads. What is left to torch is small, and its OpenMP barriers would compete with
    the rasterizer's threads for the cores.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
