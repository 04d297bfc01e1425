"""The prior network that comes with the package."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from room2dgs.config import DepthPriorConfig, NormalPriorConfig
from room2dgs.errors import InputError

NAME = "room_prior.onnx"


def shipped_network() -> Path:
    """Where room_prior.onnx lies in this installation.

    Raises:
        InputError: it is not there.
    """
    path = Path(str(files("room2dgs.depth") / "network" / NAME))
    if not path.is_file():
        raise InputError(f"{path} is missing from this installation; install room2dgs again, or give prior=none")
    return path


def model_path(settings: DepthPriorConfig | NormalPriorConfig) -> Path:
    """The .onnx file that makes the maps.

    Raises:
        InputError: it should have come with the package and is not there.
    """
    if settings.model:
        return Path(settings.model)
    return shipped_network() if settings.source == "room_prior" else Path()
