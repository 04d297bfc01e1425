"""A run's state on disk: parameters, Adam's moments, the iteration.

Nothing random needs saving: every draw in training comes from (seed, iteration), see schedule.py.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.train.tensor_file import read_tensors, write_tensors

KIND = "checkpoint"
NAME = re.compile(r"iteration_([0-9]{1,15})\.safetensors")
PARTS = ("parameter", "fixed", "adam", "extra")


@dataclass(frozen=True)
class Checkpoint:
    """State after `iteration` iterations.

    Attributes:
        iteration: iterations done.
        parameters, fixed: the decoder's tensors by name.
        adam: the optimiser's tensors by name (`model.adam_state`).
        fingerprint: the settings that decide the result (`fingerprint.fingerprint`).
        seconds: by stage, so far.
        extra: what others keep from iteration to iteration, by "owner/name", such as "strategy/visits".
    """

    iteration: int
    parameters: dict[str, Tensor]
    fixed: dict[str, Tensor]
    adam: dict[str, Tensor]
    fingerprint: dict[str, Any]
    seconds: dict[str, float]
    extra: dict[str, Tensor] = field(default_factory=dict)


def folder_of(out: Path) -> Path:
    """Where a run keeps its checkpoints."""
    return Path(out) / "checkpoints"


def save(out: Path, state: Checkpoint) -> Path:
    """Write atomically and return the path.

    Raises:
        InputError: the disk is full or not writable; earlier checkpoints are untouched.
    """
    path = folder_of(out) / f"iteration_{state.iteration:07d}.safetensors"
    groups = (state.parameters, state.fixed, state.adam, state.extra)
    tensors = {f"{part}/{k}": v for part, group in zip(PARTS, groups, strict=True) for k, v in group.items()}
    meta = {"iteration": state.iteration, "fingerprint": state.fingerprint, "seconds": state.seconds}
    write_tensors(path, KIND, tensors, meta)
    return path


def load(path: Path) -> Checkpoint:
    """Read one checkpoint.

    Raises:
        InputError: missing, damaged, or not a checkpoint.
    """
    tensors, meta = read_tensors(path, KIND)
    groups: dict[str, dict[str, Tensor]] = {part: {} for part in PARTS}
    for name, tensor in tensors.items():
        part, _, key = name.partition("/")
        if part not in groups:
            raise InputError(f"{path} has {name}, which no checkpoint has; delete it and train again")
        groups[part][key] = tensor
    iteration, seconds, fingerprint = (meta.get(key) for key in ("iteration", "seconds", "fingerprint"))
    named = NAME.fullmatch(Path(path).name)
    known = type(iteration) is int and iteration >= 0 and (named is None or int(named[1]) == iteration)
    if not known or not isinstance(fingerprint, dict) or not _are_seconds(seconds):
        raise InputError(f"{path} does not say of which iteration and run it is; delete it and train again")
    return Checkpoint(
        int(meta["iteration"]),
        groups["parameter"],
        groups["fixed"],
        groups["adam"],
        fingerprint,
        dict(meta["seconds"]),
        groups["extra"],
    )


def latest(out: Path, log: Log) -> Checkpoint | None:
    """The newest checkpoint that is whole, or None; damaged ones are passed over and named in the log."""
    for path in reversed(on_disk(out)):
        try:
            return load(path)
        except InputError as error:
            log(f"checkpoint passed over: {error}")
    return None


def on_disk(out: Path) -> list[Path]:
    """Checkpoint files, oldest first."""
    found = [path for path in folder_of(out).glob("*") if NAME.fullmatch(path.name)]
    return sorted(found, key=_iteration_of)


def up_to(out: Path, iteration: int) -> list[Path]:
    """Checkpoint files of at most `iteration` iterations, oldest first."""
    return [path for path in on_disk(out) if _iteration_of(path) <= iteration]


def keep_only(out: Path, paths: list[Path]) -> None:
    """Delete all other checkpoints, an earlier run's included."""
    for path in on_disk(out):
        if path not in paths:
            path.unlink(missing_ok=True)


def _are_seconds(values: Any) -> bool:
    """By stage, finite and not negative."""
    fits = isinstance(values, dict)
    return fits and all(type(value) in (int, float) and 0 <= value < math.inf for value in values.values())


def _iteration_of(path: Path) -> int:
    """Of a file whose name is a checkpoint's."""
    return int(path.stem.removeprefix("iteration_"))
