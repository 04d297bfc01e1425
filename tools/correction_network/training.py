"""The training loop, and what its network changes on rooms that it does not learn from."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from room2dgs.tools.correction_network.losses import WEIGHTS, losses
from room2dgs.tools.correction_network.network import CorrectionNetwork
from room2dgs.tools.correction_network.samples import Room, stacked, varied
from room2dgs.train.tensor_file import read_tensors, write_tensors

KIND, NAME = "correction-network", "checkpoint.safetensors"
WARMUP = 100  # steps
LARGEST_GRADIENT = 1.0
AVERAGE = 0.998  # decay of the weights' running mean
LEAST_RATE = 0.02  # of the learning rate, at the end
REPORT_SECONDS = 120.0
VALIDATED = 4  # reports of which one is followed by a validation
EVERY = 4  # views of which one is validated
WITHIN_M = (0.02, 0.05, 0.1)


@dataclass(frozen=True)
class Options:
    """How to train: the learning rate is full for the first half of the time, then falls as a cosine does.

    Attributes:
        steps: end the training instead of the minutes; 0: the minutes do.
    """

    minutes: float = 60.0
    steps: int = 0
    batch: int = 8
    lr: float = 1e-3
    weight_decay: float = 1e-4
    seed: int = 0


def train(
    rooms: Mapping[str, Room],
    held_out: Mapping[str, Room],
    out: Path,
    options: Options,
    start: dict[str, Tensor] | None = None,
    log: Callable[[str], None] = print,
) -> dict[str, Tensor]:
    """The weights' running mean, which out/checkpoint.safetensors keeps every few minutes.

    Args:
        rooms: to learn from.
        held_out: to validate on.
        start: weights to begin with.
    """
    torch.manual_seed(options.seed)
    random, order = torch.Generator().manual_seed(options.seed), np.random.default_rng(options.seed)
    network = CorrectionNetwork()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs lack it
    if start:
        network.load_state_dict(start)
    optimiser = torch.optim.AdamW(network.parameters(), lr=options.lr, weight_decay=options.weight_decay)
    average = {name: value.detach().clone() for name, value in network.state_dict().items()}
    views = [(name, index) for name, room in rooms.items() for index in range(len(room.shift))]
    log(f"{len(views)} views of {len(rooms)} rooms, {len(held_out)} held out")
    # without instructions for bfloat16, float32 takes a sixth of the time
    has_bfloat16 = torch.ops.mkldnn._is_mkldnn_bf16_supported()
    started = reported = time.monotonic()
    step = counted = reports = 0
    sums = dict.fromkeys((*WEIGHTS, "near before"), 0.0)
    while (done := step / options.steps if options.steps else (time.monotonic() - started) / 60 / options.minutes) < 1:
        for group in optimiser.param_groups:
            group["lr"] = options.lr * _rate(step, done)
        chosen = [views[index] for index in order.integers(0, len(views), options.batch)]
        batch = [(rooms[name].evidence[index], rooms[name].shift[index]) for name, index in chosen]
        inputs, target = varied(*stacked(batch), random)
        with torch.autocast("cpu", torch.bfloat16, enabled=has_bfloat16):
            found = network(inputs.contiguous(memory_format=torch.channels_last))
        terms = losses(found, target)
        optimiser.zero_grad()
        total: Any = sum(WEIGHTS[name] * value for name, value in terms.items())
        total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), LARGEST_GRADIENT)
        optimiser.step()
        step, counted = step + 1, counted + 1
        decay = min(AVERAGE, (1 + step) / (10 + step))
        torch._foreach_lerp_(list(average.values()), [value.detach() for value in network.parameters()], 1 - decay)
        for name, value in terms.items():
            sums[name] += float(value.detach())
        sums["near before"] += float(
            losses(found._replace(shift=torch.zeros_like(found.shift)), target)["near"].detach()
        )
        if time.monotonic() - reported > REPORT_SECONDS:
            means = ", ".join(f"{name} {total / counted:.4f}" for name, total in sums.items())
            log(f"step {step} ({done:.0%}): {means}")
            sums, counted, reported = dict.fromkeys(sums, 0.0), 0, time.monotonic()
            save(out, average, options, step)
            reports += 1
            if reports % VALIDATED == 0:
                validate(average, held_out, log)
    save(out, average, options, step)
    validate(average, held_out, log)
    return average


def save(out: Path, weights: dict[str, Tensor], options: Options, step: int) -> None:
    """Writes the run's checkpoint."""
    out.mkdir(parents=True, exist_ok=True)
    write_tensors(out / NAME, KIND, weights, {"options": vars(options), "steps": step})


def load(run: Path) -> dict[str, Tensor]:
    """The weights of a run, from its folder or file.

    Raises:
        InputError: as `read_tensors`.
    """
    return read_tensors(run / NAME if run.is_dir() else run, KIND)[0]


def validate(weights: dict[str, Tensor], rooms: Mapping[str, Room], log: Callable[[str], None]) -> None:
    """Logs the shares of pixels within `WITHIN_M` of the truth, before and after, for each room."""
    network = CorrectionNetwork()
    network.load_state_dict(weights)
    for name, room in rooms.items():
        chosen = range(0, len(room.shift), EVERY)
        shares = np.mean([_shares(network, room, index) for index in chosen], axis=0)
        before, after = ("/".join(f"{share:.3f}" for share in row) for row in shares)
        log(f"  {name}: within {'/'.join(f'{100 * m:g}' for m in WITHIN_M)} cm {before} -> {after}")


@torch.no_grad()
def _shares(network: CorrectionNetwork, room: Room, index: int) -> np.ndarray:
    """(2, len(WITHIN_M)) of one view."""
    inputs, target = stacked([(room.evidence[index], room.shift[index])])
    known = torch.isfinite(target.shift)
    true = (target.depth * target.shift.exp())[known]
    offs = [(target.depth * shift.exp())[known] - true for shift in (torch.zeros(1), network(inputs).shift)]
    return np.array([[float((off.abs() < limit).float().mean()) for limit in WITHIN_M] for off in offs])


def _rate(step: int, done: float) -> float:
    fall = 1.0 if done < 0.5 else LEAST_RATE + (1 - LEAST_RATE) * (1 + math.cos(math.pi * (2 * done - 1))) / 2
    return min(1.0, (step + 1) / WARMUP) * fall
