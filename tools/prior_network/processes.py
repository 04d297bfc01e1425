"""Batches made by processes, in order: a GPU wants more of them than one core makes."""

from __future__ import annotations

import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager

import cv2
import numpy as np
import torch

from room2dgs.tools.prior_network.batches import Batch
from room2dgs.tools.prior_network.losses import Truth

AHEAD = 2  # batches for each process that are asked for before their turn


@contextmanager
def made_by_processes(make: Callable[[int], Batch], processes: int) -> Iterator[Iterator[Batch]]:
    """make(0), make(1), ... made by so many processes while the caller computes; the same batches as without them.

    Args:
        make: can be pickled.
    """
    pool = ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), initializer=_start)
    waiting: deque[Future[list[np.ndarray]]] = deque()

    def batches() -> Iterator[Batch]:
        number = 0
        while True:
            while len(waiting) < AHEAD * processes:
                waiting.append(pool.submit(_arrays, make, number))
                number += 1
            image, intrinsics, *truth = (torch.from_numpy(array) for array in waiting.popleft().result())
            yield Batch(image.permute(0, 3, 1, 2), intrinsics, Truth(*truth))

    try:
        yield batches()
    finally:
        pool.shutdown(cancel_futures=True)


def _start() -> None:
    torch.set_num_threads(1)
    cv2.setNumThreads(1)


def _arrays(make: Callable[[int], Batch], number: int) -> list[np.ndarray]:
    """A batch's arrays, since tensors would go through files; the image with its channels last, as it lies."""
    batch = make(number)
    return [tensor.numpy() for tensor in (batch.image.permute(0, 2, 3, 1), batch.intrinsics, *batch.truth)]
