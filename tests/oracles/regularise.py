"""The primal-dual method on a whole box of voxels, in float64: the oracle of csrc/regularise_kernels.cpp."""

from __future__ import annotations

import numpy as np


def energy(value: np.ndarray, data: np.ndarray, weight: np.ndarray, share: float, soft: float) -> float:
    """sum w / 2 (u - f)^2 + share h(|grad u|)."""
    length = np.sqrt((gradient(value) ** 2).sum(axis=0))
    huber = np.where(length < soft, length**2 / (2 * soft), length - soft / 2)
    return float((weight / 2 * (value - data) ** 2).sum() + share * huber.sum())


def gradient(value: np.ndarray) -> np.ndarray:
    """(3, X, Y, Z) forward differences, 0 at the far sides."""
    return np.stack([np.diff(value, axis=k, append=value.take([-1], axis=k)) for k in range(3)])


def divergence(dual: np.ndarray) -> np.ndarray:
    """Minus the adjoint of `gradient`."""
    total = np.zeros(dual.shape[1:])
    for k, part in enumerate(dual):
        inner = part.copy()
        inner[(slice(None),) * k + (-1,)] = 0
        total += np.diff(inner, axis=k, prepend=0)
    return total


def regularised(
    value: np.ndarray, data: np.ndarray, weight: np.ndarray, share: float, soft: float, step: float, steps: int
) -> np.ndarray:
    """`value` after so many steps from dual variables of zero."""
    ahead, dual = value.copy(), np.zeros((3, *value.shape))
    for _ in range(steps):
        dual = (dual + step * gradient(ahead)) / (1 + step * soft / share)
        dual /= np.maximum(1, np.sqrt((dual**2).sum(axis=0)) / share)
        before = value
        value = (value + step * divergence(dual) + step * weight * data) / (1 + step * weight)
        ahead = 2 * value - before
    return value
