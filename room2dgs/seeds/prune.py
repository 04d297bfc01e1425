"""Contribution-based pruning (the paper's Sec. III-B): seeds that contribute to no image."""

from __future__ import annotations

import numpy as np


def transparent(opacities: np.ndarray, threshold: float) -> np.ndarray:
    """(S,) bool: no surfel of the seed is more opaque than the threshold.

    The paper accumulates a seed's opacity over N_alpha iterations; here it is the mean over them, so that the
    threshold does not depend on N_alpha, and the largest of the seed's surfels, so that it does not depend on k.

    Args:
        opacities: (S, k) means over the iterations.
        threshold: theta_alpha.

    Raises:
        ValueError: they are no (S, k), k > 0.
    """
    opacities = np.asarray(opacities)
    if opacities.ndim != 2 or not opacities.shape[1]:
        raise ValueError(f"opacities have shape {opacities.shape}, not (S, k)")
    return opacities.max(axis=1) < threshold


def unseen(iterations: np.ndarray, views: int) -> np.ndarray:
    """(S,) bool: no training view has seen anything of the seed.

    Args:
        iterations: (S,) in a row without a gradient: nothing of the seed reached a pixel.
        views: training views. Every epoch is a permutation of them, so two epochs' length surely holds each.
    """
    return iterations >= 2 * views
