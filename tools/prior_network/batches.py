"""Training batches: which samples, and what is done to them, follow from (seed, step)."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.tools.prior_network.geometric import Seen, random_view, seen_in, view_of
from room2dgs.tools.prior_network.losses import Truth
from room2dgs.tools.prior_network.network import OUTPUT_STRIDE
from room2dgs.tools.prior_network.photographic import photo
from room2dgs.tools.prior_network.rays import plane_distance, ray_slopes
from room2dgs.tools.prior_network.shards import Shards

READ_AHEAD = 3
# streams of random numbers, so that no two uses share one
ORDER, TRAINING, VALIDATION = 1, 2, 3


class Batch(NamedTuple):
    """Attributes: image (B, 3, H, W) in [0, 1]; intrinsics (B, 3, 3); truth."""

    image: Tensor
    intrinsics: Tensor
    truth: Truth


def moved(batch: Batch, device: torch.device) -> Batch:
    """The batch on a device."""
    there = [tensor.to(device, non_blocking=True) for tensor in (batch.image, batch.intrinsics, *batch.truth)]
    return Batch(there[0], there[1], Truth(*there[2:]))


def training_batch(shards: Shards, size: tuple[int, int], places: range, seed: int) -> Batch:
    """Samples at these places of the endless row of shuffled passes over the data, each augmented anew."""
    made = []
    for place in places:
        rng = np.random.default_rng([seed, TRAINING, place])
        sample = shards[_sample_at(place, len(shards), seed)]
        height, width = sample.depth.shape
        seen = seen_in(sample, random_view((width, height), size, rng), size)
        made.append((seen, photo(seen.radiance, rng)))
    return _stacked(made)


def validation_batch(shards: Shards, size: tuple[int, int], indices: list[int], seed: int) -> Batch:
    """Whole views with the photographic effects, the same at each call."""
    made = []
    for index in indices:
        rng = np.random.default_rng([seed, VALIDATION, index])
        sample = shards[index]
        height, width = sample.depth.shape
        seen = seen_in(sample, view_of((width, height), size), size)
        made.append((seen, photo(seen.radiance, rng)))
    return _stacked(made)


@contextmanager
def read_ahead(make: Callable[[int], Batch]) -> Iterator[Iterator[Batch]]:
    """make(0), make(1), ... made in a thread while the caller computes."""
    ready: queue.Queue[Batch | BaseException] = queue.Queue(READ_AHEAD)
    stop = threading.Event()

    def work() -> None:
        number = 0
        while not stop.is_set():
            try:
                item: Batch | BaseException = make(number)
            except BaseException as error:
                item = error
            while not stop.is_set():
                try:
                    ready.put(item, timeout=0.2)
                    break
                except queue.Full:
                    continue
            if isinstance(item, BaseException):
                return
            number += 1

    def batches() -> Iterator[Batch]:
        while True:
            item = ready.get()
            if isinstance(item, BaseException):
                raise item
            yield item

    worker = threading.Thread(target=work, name="batches", daemon=True)
    worker.start()
    try:
        yield batches()
    finally:
        stop.set()
        worker.join()


def _sample_at(place: int, samples: int, seed: int) -> int:
    """The sample at a place of the endless row of shuffled passes."""
    number, within = divmod(place, samples)
    return int(_order(samples, seed, number)[within])


_orders: dict[tuple[int, int, int], np.ndarray] = {}


def _order(samples: int, seed: int, number: int) -> np.ndarray:
    """The shuffled order of one pass; the last two are kept."""
    key = (samples, seed, number)
    if key not in _orders:
        for old in list(_orders)[:-1]:
            _orders.pop(old, None)
        _orders[key] = np.random.default_rng([seed, ORDER, number]).permutation(samples)
    return _orders[key]


def _stacked(made: list[tuple[Seen, np.ndarray]]) -> Batch:
    # (B, H, W, 3) seen as (B, 3, H, W) is channels-last, which the CPU's convolutions want
    image = torch.from_numpy(np.stack([image for _, image in made])).permute(0, 3, 1, 2).float() / 255.0
    depth = torch.from_numpy(np.stack([seen.depth for seen, _ in made]))[:, None]
    normal = torch.from_numpy(np.stack([seen.normal for seen, _ in made])).permute(0, 3, 1, 2)
    intrinsics = torch.from_numpy(np.stack([seen.intrinsics for seen, _ in made]))
    slopes = ray_slopes(intrinsics, depth.shape[-2], depth.shape[-1], OUTPUT_STRIDE)
    return Batch(image, intrinsics, Truth(depth, normal, plane_distance(depth, normal, slopes)))
