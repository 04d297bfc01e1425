"""How sure a depth is, and the error that stands for."""

from __future__ import annotations

import numpy as np

HALF = 0.025  # relative error at which a completed depth's confidence is a half


def confidence(relative_error: np.ndarray) -> np.ndarray:
    """1 / (1 + (error / HALF)^2), float32."""
    return (1 / (1 + (relative_error / HALF) ** 2)).astype(np.float32)


def error_of(sure: np.ndarray) -> np.ndarray:
    """The relative error that a confidence above 0 stands for, float32; the inverse of `confidence`."""
    return (HALF * np.sqrt(1 / sure - 1)).astype(np.float32)
