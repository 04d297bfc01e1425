"""Settings of a training run."""

from __future__ import annotations

from dataclasses import dataclass

from room2dgs.errors import InputError

STRIDE = 32


@dataclass(frozen=True)
class TrainOptions:
    """How to train.

    Attributes:
        size: (width, height) of the training images, multiples of 32.
        steps: steps of the optimiser.
        minutes: 0, or end after so many minutes if that comes before `steps`; such a run depends on the clock.
        batch: samples a step.
        lr: AdamW's learning rate; the encoder learns at `encoder_lr` of it.
        encoder_lr: a factor.
        warmup: steps from 0 to the full rate.
        decay: share of the run, at its end, in which the rate falls linearly to 0.
        weight_decay: of AdamW.
        average: decay of the running mean of the weights, which is validated and exported.
        held_out: shards, the first by name, that are kept for validation.
        validate_every: steps.
        validation_samples: at most so many.
        save_minutes: between checkpoints.
        seed: decides order and augmentation.
        device: "cpu", "cuda", or "auto": a GPU where there is one.
        precision: "float32", or "bf16" where a GPU, or a CPU with AMX or AVX-512, multiplies so.
        workers: processes that make batches; 0: a thread, enough for a CPU.
    """

    size: tuple[int, int] = (256, 192)
    steps: int = 20000
    minutes: float = 0.0
    batch: int = 8
    lr: float = 1e-3
    encoder_lr: float = 0.25
    warmup: int = 300
    decay: float = 0.3
    weight_decay: float = 0.01
    average: float = 0.999
    held_out: int = 1
    validate_every: int = 500
    validation_samples: int = 96
    save_minutes: float = 4.0
    seed: int = 0
    device: str = "cpu"
    precision: str = "float32"
    workers: int = 0


LIMITS = {
    "steps": (1, 10**8),
    "minutes": (0, 10**5),
    "batch": (1, 4096),
    "lr": (1e-8, 1.0),
    "encoder_lr": (0.0, 10.0),
    "warmup": (0, 10**6),
    "decay": (0.0, 1.0),
    "weight_decay": (0.0, 1.0),
    "average": (0.0, 0.999999),
    "held_out": (0, 10**6),
    "validate_every": (1, 10**8),
    "validation_samples": (1, 10**6),
    "save_minutes": (0.0, 10**5),
    "seed": (0, 2**63 - 1),
    "workers": (0, 256),
}
CHOICES = {"device": ("cpu", "cuda", "auto"), "precision": ("float32", "bf16")}


def check_options(options: TrainOptions) -> None:
    """Raises InputError if a setting is out of range."""
    for name, (low, high) in LIMITS.items():
        value = getattr(options, name)
        if not low <= value <= high:
            raise InputError(f"--{name.replace('_', '-')} is {value}; give a value from {low} to {high}")
    for name, allowed in CHOICES.items():
        if getattr(options, name) not in allowed:
            raise InputError(f"--{name} is {getattr(options, name)}; choose from {', '.join(allowed)}")
    if any(side < STRIDE or side % STRIDE for side in options.size):
        width, height = options.size
        raise InputError(f"--size is {width}x{height}; give multiples of {STRIDE}, such as 256x192")


def learning_rate_factor(options: TrainOptions, step: int, seconds: float) -> float:
    """0 to 1: warm-up, a plateau, a linear fall to 0 over the last `decay` of the run."""
    done = progress(options, step, seconds)
    warm = min(1.0, (step + 1) / (options.warmup + 1))
    fall = (1.0 - done) / options.decay if options.decay > 0 else 1.0
    return max(0.0, min(warm, fall, 1.0))


def progress(options: TrainOptions, step: int, seconds: float) -> float:
    """0 at the start, 1 at the end."""
    by_clock = seconds / (60.0 * options.minutes) if options.minutes > 0 else 0.0
    return min(1.0, max(step / options.steps, by_clock))
