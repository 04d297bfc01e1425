"""The result of training as a file: activated surfels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from room2dgs.errors import InputError
from room2dgs.splat.types import Surfels
from room2dgs.train.tensor_file import read_tensors, write_tensors

KIND = "surfels"


def save_surfels(path: Path, surfels: Surfels, meta: dict[str, Any]) -> None:
    """Write surfels (metres and probabilities) and what made them.

    Raises:
        InputError: the file cannot be written.
    """
    write_tensors(path, KIND, surfels._asdict(), meta)


def load_surfels(path: Path) -> Surfels:
    """Read what `save_surfels` wrote.

    Raises:
        InputError: missing, damaged, or not a file of surfels.
    """
    tensors, _ = read_tensors(Path(path), KIND)
    if set(tensors) != set(Surfels._fields):
        raise InputError(f"{path} lacks {', '.join(sorted(set(Surfels._fields) - set(tensors)))}; train again")
    surfels = Surfels(**tensors)
    if not all(bool(torch.isfinite(value).all()) for value in surfels):
        raise InputError(f"{path} holds numbers that are not finite; train again")
    return surfels


def surfels_meta(path: Path) -> dict[str, Any]:
    """Arguments of `save_surfels`: iteration, sh_degree, background, near_m, seeds, settings.

    Raises:
        InputError: missing, damaged, or not a file of surfels.
    """
    return read_tensors(Path(path), KIND)[1]
