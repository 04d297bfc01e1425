"""The confidence in each pixel of a network's map, from the error that the network expects."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.config import OnnxConfig
from room2dgs.depth.network.map_cache import SUFFIX, has_array, read_array


def confidence_of(error: np.ndarray, settings: OnnxConfig) -> np.ndarray:
    """1 / (1 + (error / error_scale)^2): 1 for no error, a half at `error_scale`.

    Args:
        error: (H, W) expected error, of ln depth or in radians.

    Returns:
        (H, W) float32 in 0..1; 0 where the error is more than `max_error` or no number.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        confidence = 1.0 / (1.0 + (error / settings.error_scale) ** 2)
        return np.where(error <= settings.max_error, confidence, 0.0).astype(np.float32)


def has_confidence(path: Path) -> bool:
    """Whether a map on disk has expected errors: files of the user and of other networks have none.

    Raises:
        InputError: a damaged file.
    """
    return path.suffix == SUFFIX and has_array(path, "error")


def read_confidence(path: Path, settings: OnnxConfig) -> np.ndarray | None:
    """The confidence that belongs to a map on disk; None for maps without expected errors.

    Raises:
        InputError: a damaged file.
    """
    error = read_array(path, "error") if path.suffix == SUFFIX else None
    return None if error is None else confidence_of(error, settings)
