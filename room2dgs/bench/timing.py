"""Times of small pieces of work on a machine that others use too."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def best_seconds(run: Callable[[], Any], repeats: int) -> float:
    """The fastest of `repeats` runs after one that is not counted: what is slower is other people's work."""
    run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)
