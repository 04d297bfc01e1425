"""A parallel map with results in order; numpy and the kernels release the interpreter's lock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from room2dgs.cores import available_cores

MOST_READERS = 32  # threads
Thing = TypeVar("Thing")
Result = TypeVar("Result")


def parallel_map(
    function: Callable[[Thing], Result], things: Iterable[Thing], threads: int | None = None
) -> Iterator[Result]:
    """What the function gives for each of the things, in their order; the first error as it comes up.

    Args:
        function: is called in other threads, so it must not change what the next call reads.
        things: are taken one by one, no more than two for each thread before their results are asked for.
        threads: that work at once; None: a few more than there are cores, for files that the disk is waited for.
    """
    threads = min(MOST_READERS, available_cores() + 4) if threads is None else threads
    with ThreadPoolExecutor(threads) as pool:
        waiting: deque[Future[Result]] = deque()
        try:
            for thing in things:
                waiting.append(pool.submit(function, thing))
                if len(waiting) == 2 * threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for one in waiting:
                one.cancel()
