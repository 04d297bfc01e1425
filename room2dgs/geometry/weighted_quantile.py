"""Quantiles of values that count differently."""

from __future__ import annotations

import numpy as np


def weighted_quantile(values: np.ndarray, weight: np.ndarray, share: float) -> float:
    """Of values (N,) with weights (N,), of which one is above 0.

    Between two values in the middle of which the share falls, their mean by weight.
    """
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weight[order]) - weight[order] / 2
    return float(np.interp(share * weight.sum(), reached, values[order]))
