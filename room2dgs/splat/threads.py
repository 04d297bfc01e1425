"""How many threads the compiled kernels use."""

from __future__ import annotations

from room2dgs import _C
from room2dgs.cores import available_cores


def set_threads(count: int | None = None) -> int:
    """Threads of the compiled kernels from now on; None: every core that this process may use.

    The results are the same bits for any number.

    Returns:
        The number in use.
    """
    _C.set_threads(count or available_cores())
    return _C.threads()


set_threads()
