"""Training's state on disk: weights, their running mean, AdamW's moments, and what decides the rest."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.tools.prior_network.network import PriorNetwork
from room2dgs.tools.prior_network.options import TrainOptions
from room2dgs.train.tensor_file import read_tensors, write_tensors

KIND = "prior-network"
NAME = "checkpoint.safetensors"
PARTS = ("weights", "average", "moment", "moment2")
# settings that a resumed run may change: they change no weight, or its last bits alone
FREE = ("validate_every", "validation_samples", "save_minutes", "device", "precision", "workers")


@dataclass(frozen=True)
class Checkpoint:
    """State after `step` steps.

    Attributes:
        step: steps done in this run.
        total_steps: with those of the runs that it started from; counts AdamW's steps.
        seconds: of this run, for runs that end by the clock.
        options: TrainOptions as a dict.
        shards: names of the run's shards, held out ones included.
        history: one entry for each earlier run: its options, shards, steps and seconds.
        tensors: by part and parameter name.
    """

    step: int
    total_steps: int
    seconds: float
    options: dict[str, Any]
    shards: list[str]
    history: list[dict[str, Any]]
    tensors: dict[str, dict[str, Tensor]]


def save_checkpoint(path: Path, state: Checkpoint) -> None:
    """Write atomically.

    Raises:
        InputError: the file cannot be written; an earlier one is untouched.
    """
    tensors = {f"{part}/{name}": tensor for part in PARTS for name, tensor in state.tensors[part].items()}
    meta = {key: value for key, value in vars(state).items() if key != "tensors"}
    write_tensors(path, KIND, tensors, meta)


def load_checkpoint(path: Path, grow: bool = False) -> Checkpoint:
    """Read a checkpoint, from its file or the folder of its run.

    Args:
        path: the file or the folder.
        grow: take that of a smaller network as well, and start what it lacks (parameters, and outputs of those it has)
            as in a new network, without moments.

    Raises:
        InputError: missing, damaged, not a checkpoint of this network.
    """
    path = path / NAME if path.is_dir() else path
    tensors, meta = read_tensors(path, KIND)
    parts: dict[str, dict[str, Tensor]] = {name: {} for name in PARTS}
    for key, tensor in tensors.items():
        which, _, name = key.partition("/")
        parts[which][name] = tensor
    network = PriorNetwork()
    wanted = {name: parameter.shape for name, parameter in network.named_parameters()}
    for key, part in parts.items():
        if grow:
            _grow(part, network, keep=key in ("weights", "average"))
        if {name: tensor.shape for name, tensor in part.items()} != wanted:
            raise InputError(f"{path} holds another network than this version's; train it again")
    return Checkpoint(tensors=parts, **{key: meta[key] for key in Checkpoint.__annotations__ if key != "tensors"})


def _grow(part: dict[str, Tensor], network: PriorNetwork, keep: bool) -> None:
    """Adds in place what the network has and the part lacks: the network's values if `keep`, else zeros."""
    for name, parameter in network.named_parameters():
        new = parameter.detach().clone() if keep else torch.zeros_like(parameter)
        old = part.get(name, new[:0])
        if old.shape[1:] == new.shape[1:] and len(old) < len(new):
            part[name] = torch.cat([old, new[len(old) :]])


def average_network(state: Checkpoint) -> PriorNetwork:
    """The network with the running mean of the weights, for use."""
    network = PriorNetwork()
    network.load_state_dict(state.tensors["average"])
    return network.eval()


def check_same_run(path: Path, state: Checkpoint, options: TrainOptions) -> None:
    """Raises InputError if the checkpoint is of a run with other settings."""
    now = as_json(options)
    for name, value in now.items():
        if name not in FREE and state.options.get(name) != value:
            raise InputError(
                f"{path} was trained with {name} {state.options.get(name)}, not {value}; "
                "give the same settings to go on, or another folder"
            )


def as_json(options: TrainOptions) -> dict[str, Any]:
    """The options as JSON gives them back."""
    return {**asdict(options), "size": list(options.size)}


def state_tensors(
    network: PriorNetwork, average: dict[str, Tensor], optimiser: torch.optim.Optimizer
) -> dict[str, dict[str, Tensor]]:
    """Copies in main memory of all that a checkpoint keeps."""
    parts: dict[str, dict[str, Tensor]] = {name: {} for name in PARTS}
    for name, parameter in network.named_parameters():
        moments = optimiser.state.get(parameter, {})
        kept = {"weights": parameter.detach(), "average": average[name]}
        for part, key in (("moment", "exp_avg"), ("moment2", "exp_avg_sq")):
            kept[part] = moments[key] if key in moments else torch.zeros_like(parameter)
        for part, values in kept.items():
            parts[part][name] = values.to("cpu", copy=True)
    return parts
