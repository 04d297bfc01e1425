"""Decompresses Apple's LZFSE to a known size and no more.

The package's own function doubles its memory until everything fits, and a block of a few bytes may stand for hundreds
of megabytes: its C function, which fills a buffer that is given, is called instead.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

from room2dgs.captures.opened_images import MOST_DEPTH_PIXELS
from room2dgs.errors import InputError

MOST_BYTES = 4 * MOST_DEPTH_PIXELS


def unpacked_lzfse(data: bytes, size: int, label: str) -> bytes:
    """What was packed.

    Args:
        size: bytes that it must have.
        label: what messages call it.

    Raises:
        InputError: the package is missing; the data are damaged or of another size.
    """
    if size > MOST_BYTES:
        raise InputError(f"{label} would have {size >> 20} MiB, too large for a depth map; export the capture again")
    decode = _decoder()
    if decode is None:
        raise InputError(f"{label} is packed by LZFSE; install pyliblzfse (pip install 'room2dgs[phones]')")
    buffer = ctypes.create_string_buffer(size + 1)
    count = decode(buffer, size + 1, data, len(data), None)
    if count == 0:
        raise InputError(f"{label} cannot be unpacked: it is damaged; export the capture again")
    if count != size:
        found = f"{count} bytes" if count < size else "more"
        raise InputError(f"{label} unpacks to {found} where {size} belong; export the capture again")
    return buffer.raw[:size]


@lru_cache(maxsize=1)
def _decoder() -> Any:
    """size_t lzfse_decode_buffer(dst, dst_size, src, src_size, scratch); None where it is not installed."""
    try:
        import liblzfse

        decode = ctypes.CDLL(liblzfse.__file__).lzfse_decode_buffer
    except (ImportError, OSError, AttributeError):
        return None
    decode.restype = ctypes.c_size_t
    decode.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p]
    return decode
