"""Gradients of a step, by one process or two.

A batch is cut into PARTS whose gradients are added in a fixed order, so the bits do not depend on how many processes
compute them. Processes meet once a step; threads of one process would meet at every layer, and wait for each other
whenever something else uses a core.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import torch
from torch import Tensor

from room2dgs.tools.prior_network.batches import Batch, read_ahead, training_batch
from room2dgs.tools.prior_network.losses import losses
from room2dgs.tools.prior_network.memory import keep_freed_memory
from room2dgs.tools.prior_network.network import PriorNetwork
from room2dgs.tools.prior_network.options import TrainOptions
from room2dgs.tools.prior_network.shards import open_shards

PARTS = 2


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
        threads: 1: this process alone; from 2 on, two processes with half of them each.
    """
    parameters: list[torch.Tensor] = list(network.parameters())
    with ExitStack() as stack:
        if threads < 2:
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
            found = [_part_gradients(network, next(batches)) for _ in range(PARTS if helper is None else 1)]
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


def _part_gradients(network: PriorNetwork, batch: Batch) -> tuple[dict[str, float], list[Tensor]]:
    """The losses of a part of a batch and their gradients; zeros for a part of no samples."""
    parameters = list(network.parameters())
    terms = losses(network(batch.image, batch.intrinsics), batch.truth)
    gradients = torch.autograd.grad(terms["loss"], parameters)
    return {name: float(value.detach()) for name, value in terms.items()}, list(gradients)


def _places(options: TrainOptions, step: int, part: int) -> range:
    """A part's places in the endless row of samples."""
    first = step * options.batch
    return range(first + part * options.batch // PARTS, first + (part + 1) * options.batch // PARTS)


@contextmanager
def _part_batches(work: Work, parts: range) -> Iterator[Iterator[Batch]]:
    """These parts of one step after the other."""
    shards, options = open_shards(work.data, work.shards), work.options

    def make(number: int) -> Batch:
        step, part = divmod(number, len(parts))
        return training_batch(shards, options.size, _places(options, work.start + step, parts[part]), options.seed)

    with read_ahead(make) as batches:
        yield batches


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
                terms, found = _part_gradients(network, next(batches))
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
