"""Memory that the C library keeps."""

from __future__ import annotations

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
# the largest that glibc takes
MMAP_THRESHOLD = 32 * 2**20
KEEP = 2**30


def keep_freed_memory() -> None:
    """Lets glibc reuse large blocks; asked from the system anew, each step's maps cost as much as computing them."""
    if sys.platform != "linux":
        return
    try:
        library = ctypes.CDLL("libc.so.6")
        library.mallopt(M_MMAP_THRESHOLD, MMAP_THRESHOLD)
        library.mallopt(M_TRIM_THRESHOLD, KEEP)
    except (OSError, AttributeError):
        # another C library: only slower
        return
