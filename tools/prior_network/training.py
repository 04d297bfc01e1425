"""The training loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.files import remove_leftovers
from room2dgs.tools.prior_network.checkpoint import (
    NAME,
    Checkpoint,
    as_json,
    check_same_run,
    load_checkpoint,
    save_checkpoint,
    state_tensors,
)
from room2dgs.tools.prior_network.encoder import imagenet_file, load_imagenet
from room2dgs.tools.prior_network.from_onnx import exported_weights
from room2dgs.tools.prior_network.gradients import NextGradients, Work, gradient_maker
from room2dgs.tools.prior_network.network import PriorNetwork
from room2dgs.tools.prior_network.options import TrainOptions, check_options, learning_rate_factor, progress
from room2dgs.tools.prior_network.shards import Shards, open_shards, shard_names
from room2dgs.tools.prior_network.validation import validate
from room2dgs.train.progress import Scalars

BETAS = (0.9, 0.98)
LARGEST_GRADIENT = 50.0
REPORT_SECONDS = 20.0
# steps in a row without a finite gradient that end a run
GIVE_UP = 50


@dataclass
class Run:
    """A run under way."""

    network: PriorNetwork
    average: dict[str, Tensor]
    optimiser: torch.optim.AdamW
    step: int
    total_steps: int
    seconds: float
    shards: list[str]
    history: list[dict]


def train(
    data: Path,
    out: Path,
    options: TrainOptions,
    start_from: Path | None = None,
    threads: int = 1,
    log: Callable[[str], None] = print,
) -> Path:
    """Train, or go on with the run in `out`; returns the checkpoint's path.

    On the CPU the same options and shards give the same bits, however often the run was broken off, on one thread or
    two. A run may go on on another device.

    Args:
        data: folder of shards.
        out: folder of the run: checkpoint.safetensors and tensorboard/.
        options: how to train.
        start_from: a checkpoint, or its run's folder, whose weights and moments to start with; or an .onnx file that
            `export_prior` wrote, whose weights to start with.
        threads: to compute with; see gradients.py.
        log: takes progress lines.

    Raises:
        InputError: an option is out of range, the data or a checkpoint cannot be used, or the loss ran away.
    """
    check_options(options)
    path = out / NAME
    remove_leftovers(out)
    run = _resumed(path, options) if path.is_file() else _begun(data, options, start_from)
    training, held_out = _split(data, run.shards, options.held_out)
    log(
        f"{out}: {len(training)} samples in {len(training.names)} shards, {len(held_out)} held out; "
        f"size {options.size[0]}x{options.size[1]}, batch {options.batch}, from step {run.step} of {options.steps}"
    )
    scalars = Scalars(out, True, run.step)
    work = Work(data, training.names, options, run.step)
    try:
        with gradient_maker(run.network, work, threads) as gradients:
            _loop(run, gradients, held_out, options, path, scalars, log)
    finally:
        scalars.close()
    return path


def _loop(
    run: Run, gradients: NextGradients, held_out: Shards, options: TrainOptions, path: Path, scalars: Scalars, log
) -> None:
    clock, saved, reported = (time.monotonic(),) * 3
    sums: dict[str, float] = {}
    counted = bad = 0
    while progress(options, run.step, run.seconds) < 1.0:
        terms, norm = _step(run, gradients, options)
        bad = 0 if math.isfinite(norm) else bad + 1
        if bad == GIVE_UP:
            raise InputError(f"--lr is {options.lr}, with which the loss ran away; give a smaller one")
        now = time.monotonic()
        run.seconds, clock = run.seconds + now - clock, now
        for name, value in {**terms, "gradient": norm}.items():
            sums[name] = sums.get(name, 0.0) + value
        counted += 1
        if now - reported > REPORT_SECONDS or counted >= options.validate_every:
            means = {name: total / counted for name, total in sums.items()}
            rate = counted * options.batch / (now - reported)
            scalars.add({f"train/{name}": value for name, value in means.items()}, run.step)
            scalars.add({"train/lr": run.optimiser.param_groups[0]["lr"], "train/samples_per_s": rate}, run.step)
            log(_line(run, options, rate, means))
            sums, counted, reported = {}, 0, now
        if now - saved > 60.0 * options.save_minutes:
            _save(path, run, options)
            saved = time.monotonic()
        if run.step % options.validate_every == 0 and len(held_out):
            _validate(run, held_out, options, scalars, log)
    _save(path, run, options)
    if len(held_out):
        _validate(run, held_out, options, scalars, log)
    log(f"{path}: done, {run.step} steps, {run.seconds / 60:.1f} minutes")


def _step(run: Run, gradients: NextGradients, options: TrainOptions) -> tuple[dict[str, float], float]:
    """One step of AdamW and of the running mean; returns the losses and the gradient's norm."""
    factor = learning_rate_factor(options, run.step, run.seconds)
    for group, share in zip(run.optimiser.param_groups, (1.0, options.encoder_lr), strict=True):
        group["lr"] = options.lr * share * factor
    terms = gradients()
    parameters = list(run.network.parameters())
    norm = float(torch.nn.utils.clip_grad_norm_(parameters, LARGEST_GRADIENT))
    if math.isfinite(norm):
        run.optimiser.step()
        run.total_steps += 1
        # the mean forgets the start: early it spans a tenth of the steps
        decay = min(options.average, (1.0 + run.total_steps) / (10.0 + run.total_steps))
        torch._foreach_lerp_(list(run.average.values()), [p.detach() for p in parameters], 1.0 - decay)
    run.step += 1
    return terms, norm


def _begun(data: Path, options: TrainOptions, start_from: Path | None) -> Run:
    """A new run, from ImageNet's weights or from a checkpoint's."""
    shards = shard_names(data)
    torch.manual_seed(options.seed)
    network = PriorNetwork()
    if start_from is None:
        load_imagenet(network.encoder, imagenet_file())
        run = _run(network, options)
    elif start_from.suffix == ".onnx":
        network.load_state_dict(exported_weights(start_from))
        run = _run(network, options)
        run.history = [{"start": start_from.name}]
    else:
        state = load_checkpoint(start_from, grow=True)
        run = _with_state(network, state, options)
        ended = {"options": state.options, "shards": len(state.shards), "steps": state.step, "seconds": state.seconds}
        run.history = [*state.history, ended]
    run.shards = shards
    return run


def _resumed(path: Path, options: TrainOptions) -> Run:
    """The run in its folder, where it was broken off."""
    state = load_checkpoint(path)
    check_same_run(path, state, options)
    run = _with_state(PriorNetwork(), state, options)
    run.step, run.seconds, run.shards, run.history = state.step, state.seconds, state.shards, state.history
    return run


def _with_state(network: PriorNetwork, state: Checkpoint, options: TrainOptions) -> Run:
    network.load_state_dict(state.tensors["weights"])
    run = _run(network, options)
    run.total_steps = state.total_steps
    for name, parameter in run.network.named_parameters():
        run.average[name].copy_(state.tensors["average"][name])
        if state.total_steps:
            run.optimiser.state[parameter] = {
                "step": torch.tensor(float(state.total_steps)),
                "exp_avg": torch.empty_like(parameter).copy_(state.tensors["moment"][name]).detach(),
                "exp_avg_sq": torch.empty_like(parameter).copy_(state.tensors["moment2"][name]).detach(),
            }
    return run


def channels_last(network: PriorNetwork) -> PriorNetwork:
    """Its weights as convolutions of a CPU like them."""
    return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs lack it


def device_of(options: TrainOptions) -> torch.device:
    """Where the network is trained.

    Raises:
        InputError: there is no GPU.
    """
    there = torch.cuda.is_available()
    if options.device == "cuda" and not there:
        raise InputError("--device is cuda, but torch finds no GPU here; give --device cpu, or install torch for CUDA")
    return torch.device("cuda" if there and options.device != "cpu" else "cpu")


def _run(network: PriorNetwork, options: TrainOptions) -> Run:
    network = channels_last(network).train().to(device_of(options))
    encoder = list(network.encoder.parameters())
    others = [parameter for name, parameter in network.named_parameters() if not name.startswith("encoder.")]
    groups = [{"params": others}, {"params": encoder}]
    optimiser = torch.optim.AdamW(groups, lr=options.lr, betas=BETAS, weight_decay=options.weight_decay, foreach=True)
    average = {name: parameter.detach().clone() for name, parameter in network.named_parameters()}
    return Run(network, average, optimiser, 0, 0, 0.0, [], [])


def _split(data: Path, names: list[str], held_out: int) -> tuple[Shards, Shards]:
    """Training and held-out shards. The first are held out: they stay so when more are made later."""
    if len(names) <= held_out:
        raise InputError(f"{data} has {len(names)} shards and {held_out} are held out; make more or lower --held-out")
    rest = open_shards(data, names[:held_out]) if held_out else Shards([])
    return open_shards(data, names[held_out:]), rest


def _save(path: Path, run: Run, options: TrainOptions) -> None:
    tensors = state_tensors(run.network, run.average, run.optimiser)
    state = Checkpoint(run.step, run.total_steps, run.seconds, as_json(options), run.shards, run.history, tensors)
    save_checkpoint(path, state)


def _validate(run: Run, held_out: Shards, options: TrainOptions, scalars: Scalars, log) -> None:
    network = channels_last(PriorNetwork()).to(device_of(options))
    network.load_state_dict(run.average)
    result = validate(network.eval(), held_out, options.size, options.validation_samples, options.batch, options.seed)
    scalars.add({f"validation/{name}": value for name, value in result.scores.items()}, run.step)
    scalars.add_pictures(result.pictures, run.step)
    log(f"step {run.step} validation: " + ", ".join(f"{name} {value:.3f}" for name, value in result.scores.items()))


def _line(run: Run, options: TrainOptions, rate: float, means: dict[str, float]) -> str:
    terms = ", ".join(f"{name} {value:.3f}" for name, value in means.items())
    done = progress(options, run.step, run.seconds)
    return f"step {run.step} ({done:.0%}, {run.seconds / 60:.1f} min, {rate:.1f} samples/s): {terms}"
