"""Views with their evidence and truth, and how they are varied."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.depth.completion import evidence
from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE
from room2dgs.tools.correction_network.losses import Target

EVIDENCE, SHIFT = "evidence.npy", "shift.npy"
GAIN, TINT, GAMMA, GRAIN = 0.25, 0.08, 0.2, 0.01  # deviations of the photo's changes
SIZE = 0.25  # deviation of ln of how much larger a room is
WITHOUT_NORMALS = 0.03  # of the samples


class Room(NamedTuple):
    """One capture's views, read from the disk as they are needed.

    Attributes:
        evidence: (N, CHANNELS, h, w) float16.
        shift: (N, h, w) float16, ln of true over completed depth, NaN = unknown.
    """

    evidence: np.ndarray
    shift: np.ndarray


def read_rooms(folder: Path) -> dict[str, Room]:
    """Name -> room, of all folders that `make_correction_data` has finished.

    Raises:
        InputError: there is none, or one is damaged.
    """
    found = {}
    for path in sorted(folder.glob("*/" + SHIFT)):
        try:
            room = Room(*(np.load(path.with_name(name), mmap_mode="r") for name in (EVIDENCE, SHIFT)))
        except NUMPY_DAMAGE as error:
            raise InputError(f"{path.parent} cannot be read; make it again") from error
        count, height, width = room.shift.shape
        if room.evidence.shape != (count, evidence.CHANNELS, height, width):
            raise InputError(f"{path.parent} is of another version of this tool; make it again")
        found[path.parent.name] = room
    if not found:
        raise InputError(f"{folder} holds no rooms; make some first (python -m room2dgs.tools.make_correction_data)")
    return found


def stacked(views: list[tuple[np.ndarray, np.ndarray]]) -> tuple[Tensor, Target]:
    """A batch as it is."""
    inputs = torch.from_numpy(np.stack([one for one, _ in views])).float()
    shift = torch.from_numpy(np.stack([one for _, one in views])).float()
    return inputs, Target(shift, completed_depth(inputs))


def completed_depth(inputs: Tensor) -> Tensor:
    """(B, h, w) metres."""
    return torch.exp(inputs[:, evidence.LN_DEPTH] + inputs[:, evidence.LN_MEDIAN])


def varied(inputs: Tensor, target: Target, random: torch.Generator) -> tuple[Tensor, Target]:
    """A batch mirrored or not, in another light, in rooms of another size."""
    count, shift, inputs = len(inputs), target.shift, inputs.clone()
    if torch.rand((), generator=random) < 0.5:
        inputs, shift = inputs.flip(-1), shift.flip(-1)
        inputs[:, [evidence.NORMAL, evidence.RAYS]] *= -1  # their x
    gain = GAIN * _normal((count, 1, 1, 1), random) + TINT * _normal((count, 3, 1, 1), random)
    photo = inputs[:, :3].clamp(min=0) ** torch.exp(GAMMA * _normal((count, 1, 1, 1), random)) * gain.exp()
    inputs[:, :3] = photo.clamp(0, 1) + GRAIN * _normal(photo.shape, random)
    inputs[:, evidence.LN_MEDIAN] += SIZE * _normal((count, 1, 1), random)
    lacking = torch.rand(count, generator=random) < WITHOUT_NORMALS
    for channel in evidence.OF_NORMALS:
        inputs[lacking, channel] = 0
    return inputs, Target(shift, completed_depth(inputs))


def _normal(shape: tuple[int, ...] | torch.Size, random: torch.Generator) -> Tensor:
    return torch.randn(shape, generator=random)
