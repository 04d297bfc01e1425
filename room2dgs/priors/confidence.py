"""How far each pixel of a network's map is believed, from the error that the network expects of itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.config import OnnxConfig
from room2dgs.priors.network.map_cache import SUFFIX, read_kept


def weight_of(error: np.ndarray, settings: OnnxConfig) -> np.ndarray:
    """1 / (1 + (error / error_scale)^2): 1 for no error, a half at `error_scale`.

    Args:
        error: (H, W) expected error, of ln depth or in radians.

    Returns:
        (H, W) float32 in 0..1; 0 where the error is more than `max_error` or no number.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        weight = 1.0 / (1.0 + (error / settings.error_scale) ** 2)
        return np.where(error <= settings.max_error, weight, 0.0).astype(np.float32)


def read_weight(path: Path, settings: OnnxConfig) -> np.ndarray | None:
    """The weights that belong to a map on disk; None where nothing tells them: files of the user, other networks.

    Raises:
        InputError: a damaged file.
    """
    error = read_kept(path, "error") if path.suffix == SUFFIX else None
    return None if error is None else weight_of(error, settings)
