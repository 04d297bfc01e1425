"""Checks that the system allows as many threads as will be needed; libraries abort where it does not."""

from __future__ import annotations

import threading

from room2dgs.cores import available_cores
from room2dgs.errors import InputError

# Pools of OpenBLAS, OpenMP, TBB, COLMAP, OpenCV, ONNX Runtime and our own, each with a thread a core
POOLS, OTHERS = 4, 8


def check_threads() -> None:
    """Start as many threads as a run has at most, all at once, and end them.

    Raises:
        InputError: the system refuses.
    """
    done = threading.Event()
    started: list[threading.Thread] = []
    wanted = POOLS * available_cores() + OTHERS
    try:
        for _ in range(wanted):
            thread = threading.Thread(target=done.wait, daemon=True)
            thread.start()
            started.append(thread)
    except (RuntimeError, MemoryError) as error:
        raise InputError(
            f"no more than {len(started)} threads can be started, a run has up to {wanted}; raise the limit (ulimit -u,"
            " ulimit -v, or the container's)"
        ) from error
    finally:
        done.set()
        for thread in started:
            thread.join()
