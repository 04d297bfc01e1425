"""How uncertain a depth is: the one unit, and the weights that are made of it.

The unit is the relative standard deviation, called sigma: the standard deviation of a depth over the depth, which is
that of ln depth; a normal's is an angle in radians. Weights, 0..1, are made of it where pixels or points are weighed
against each other, and are what `ViewMaps` keeps for the losses. All conversions are here.
"""

from __future__ import annotations

import numpy as np

COMPLETED_HALF = 0.025  # sigma of a completed depth that weighs a half
ALIGNED_HALF = 0.1  # median relative residual at the points that halves the weight of a map that is only aligned
MISFIT_HALF = 0.1  # likewise, before any optimisation, of the maps that completion bends to the points
# Of a depth of stereo, by how many consistent views it counts as: a depth of 2 is wrong as often as right.
STEREO_WEIGHT = np.array([0, 0.05, 0.25, 0.45, 0.6, 0.75, 0.85, 1.0], np.float32)


def completed_weight(sigma: np.ndarray) -> np.ndarray:
    """Weight of a completed depth: 1 / (1 + (sigma / COMPLETED_HALF)^2), float32 of the same shape."""
    return (1 / (1 + (sigma / COMPLETED_HALF) ** 2)).astype(np.float32)


def completed_sigma(weight: np.ndarray) -> np.ndarray:
    """The inverse of `completed_weight`, of weights above 0; float32."""
    return (COMPLETED_HALF * np.sqrt(1 / weight - 1)).astype(np.float32)


def measured_weight(sigma: np.ndarray, half: float, largest: float) -> np.ndarray:
    """Weight of a pixel of a network or of a depth camera: 1 / (1 + (sigma / half)^2).

    Args:
        sigma: (H, W), of depth or, in radians, of normals.
        half: sigma that weighs a half (`error_scale`).
        largest: sigma above which nothing counts (`max_error`).

    Returns:
        (H, W) float32 in 0..1; 0 where sigma is more than `largest` or no number.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        weight = 1.0 / (1.0 + (sigma / half) ** 2)
        return np.where(sigma <= largest, weight, 0.0).astype(np.float32)


def stereo_weight(num_consistent: np.ndarray) -> np.ndarray:
    """Weight of a depth of stereo, by how many consistent views it counts as; float32 of the same shape."""
    return STEREO_WEIGHT[np.minimum(num_consistent, len(STEREO_WEIGHT) - 1)]


def aligned_weight(residual: float) -> np.float32:
    """What is left of the weights of an aligned map that is so far off the points that its own photo sees.

    Args:
        residual: median relative residual at the points.
    """
    return np.float32(1 / (1 + (residual / ALIGNED_HALF) ** 2))


def misfit_divisor(misfit: float) -> np.float32:
    """By what the prior's weight is divided in completion where it does badly at the points.

    Args:
        misfit: median relative residual at the points, before any optimisation.
    """
    return np.float32(1 + (misfit / MISFIT_HALF) ** 4)
