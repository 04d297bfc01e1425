"""Returns freed memory to the system."""

from __future__ import annotations

import ctypes
import sys

M_ARENA_MAX = -8  # of glibc's mallopt


def give_back() -> None:
    """glibc keeps what a stage has freed between what is still in use: hundreds of megabytes after stereo."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
        if trim is not None:
            trim(ctypes.c_size_t(0))


def one_arena() -> None:
    """All threads allocate from one heap, from now on: glibc gives each its own, and each keeps holes of its own.

    To be called before there are threads. Most stages take up to a tenth less, and no processor time that could be
    measured (docs/results.md).
    """
    if sys.platform == "linux":
        choose = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
        if choose is not None:
            choose(ctypes.c_int(M_ARENA_MAX), ctypes.c_int(1))
