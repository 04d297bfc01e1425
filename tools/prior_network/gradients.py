"""Gradients of a step, by one process or two, or by a GPU.

A batch is cut into PARTS whose gradients are added in a fixed order, so the bits do not depend on how many processes
compute them. Processes meet once a step; threads of one process would meet at every layer, and wait for each other
whenever something else uses a core.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import torch
from torch import Tensor

from room2dgs.tools.prior_network.batches import Batch, moved, read_ahead, training_batch
from room2dgs.tools.prior_network.losses import losses
from room2dgs.tools.prior_network.memory import keep_freed_memory
from room2dgs.tools.prior_network.network import PriorNetwork
from room2dgs.tools.prior_network.options import TrainOptions
from room2dgs.tools.prior_network.processes import made_by_processes
from room2dgs.tools.prior_network.shards import Shards, open_shards

PARTS = 2
PRECISIONS = {"float32": torch.float32, "bf16": torch.bfloat16}


@dataclass(frozen=True)
class Work:
    """What a process must know to make its batches.

    Attributes:
        data: folder of the shards.
        shards: names of those to train on.
        options: of the run.
        start: first step.
    """

    data: Path
    shards: list[str]
    options: TrainOptions
    start: int


# computes the next step's gradients into the parameters' .grad; returns the terms of the loss
NextGradients = Callable[[], dict[str, float]]


@contextmanager
def gradient_maker(network: PriorNetwork, work: Work, threads: int) -> Iterator[NextGradients]:
    """Gives a function that computes one step's gradients after the other.

    Args:
        network: its parameters are moved to shared memory if there are two processes.
        work: what to train on.
        threads: 1, or a GPU: this process alone; from 2 on, two processes with half of them each.
    """
    parameters: list[torch.Tensor] = list(network.parameters())
    with ExitStack() as stack:
        if threads < 2 or parameters[0].is_cuda:
            batches = stack.enter_context(_part_batches(work, range(PARTS)))
            helper = None
        else:
            for parameter in parameters:
                parameter.data.share_memory_()
            shared = [torch.zeros_like(parameter).share_memory_() for parameter in parameters]
            helper = stack.enter_context(_helper(parameters, shared, work, threads - threads // 2))
            batches = stack.enter_context(_part_batches(work, range(1)))

        def compute() -> dict[str, float]:
            if helper is not None:
                helper.send(True)
            here = range(PARTS if helper is None else 1)
            found = [part_gradients(network, next(batches), work.options.precision) for _ in here]
            if helper is not None:
                found.append((_answer(helper), shared))
            weights = [len(_places(work.options, 0, part)) / work.options.batch for part in range(PARTS)]
            total = torch._foreach_mul(found[0][1], weights[0])
            for (_, gradients), weight in zip(found[1:], weights[1:], strict=True):
                torch._foreach_add_(total, gradients, alpha=weight)
            for parameter, gradient in zip(parameters, total, strict=True):
                parameter.grad = gradient
            return {
                name: sum(weight * terms[name] for (terms, _), weight in zip(found, weights, strict=True))
                for name in found[0][0]
            }

        yield compute


def part_gradients(network: PriorNetwork, batch: Batch, precision: str) -> tuple[dict[str, float], list[Tensor]]:
    """The losses of a part of a batch and their gradients; zeros for a part of no samples.

    Args:
        batch: anywhere; it is moved to where the network is.
        precision: "float32", or "bf16": layers whose products bear it are computed so, the maps and losses are not.
    """
    parameters = list(network.parameters())
    device = parameters[0].device
    batch = moved(batch, device)
    with torch.autocast(device.type, PRECISIONS[precision], enabled=precision != "float32"):
        maps = network(batch.image, batch.intrinsics)
    terms = losses(maps, batch.truth)
    gradients = torch.autograd.grad(terms["loss"], parameters)
    values = torch.stack(list(terms.values())).detach().tolist()
    return dict(zip(terms, values, strict=True)), list(gradients)


def _places(options: TrainOptions, step: int, part: int) -> range:
    """A part's places in the endless row of samples."""
    first = step * options.batch
    return range(first + part * options.batch // PARTS, first + (part + 1) * options.batch // PARTS)


@contextmanager
def _part_batches(work: Work, parts: range) -> Iterator[Iterator[Batch]]:
    """These parts of one step after the other."""
    make = partial(_part_batch, work, parts)
    ahead = made_by_processes(make, work.options.workers) if work.options.workers else read_ahead(make)
    with ahead as batches:
        yield batches


def _part_batch(work: Work, parts: range, number: int) -> Batch:
    """The number-th of these parts of one step after the other."""
    step, part = divmod(number, len(parts))
    places = _places(work.options, work.start + step, parts[part])
    return training_batch(_shards(work.data, tuple(work.shards)), work.options.size, places, work.options.seed)


@lru_cache(maxsize=1)
def _shards(data: Path, names: tuple[str, ...]) -> Shards:
    return open_shards(data, list(names))


@contextmanager
def _helper(parameters: list[Tensor], gradients: list[Tensor], work: Work, threads: int) -> Iterator[Connection]:
    """A process that computes the last part of every step when told to."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    values = [parameter.detach() for parameter in parameters]
    process = context.Process(target=_help, args=(there, values, gradients, work, threads), daemon=True)
    process.start()
    there.close()
    try:
        yield here
    finally:
        here.close()
        process.join(timeout=30)
        if process.is_alive():
            process.terminate()


def _help(pipe: Connection, values: list[Tensor], gradients: list[Tensor], work: Work, threads: int) -> None:
    """The helper's life: until the pipe ends, which it does with the other process as well."""
    keep_freed_memory()
    torch.set_num_threads(threads)
    torch.set_flush_denormal(True)
    cv2.setNumThreads(1)
    network = PriorNetwork().train()
    for parameter, value in zip(network.parameters(), values, strict=True):
        parameter.data = value
    try:
        with _part_batches(work, range(PARTS - 1, PARTS)) as batches:
            while True:
                pipe.recv()
                terms, found = part_gradients(network, next(batches), work.options.precision)
                torch._foreach_copy_(gradients, found)
                pipe.send(terms)
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return
    except Exception as error:
        pipe.send(error)


def _answer(pipe: Connection) -> dict[str, float]:
    try:
        answer = pipe.recv()
    except EOFError as error:
        raise RuntimeError("the second process ended; is there memory enough?") from error
    if isinstance(answer, Exception):
        raise answer
    return answer
