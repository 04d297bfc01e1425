"""Depth that is not completed, stored as it is: aligned or measured, perhaps jointly optimised."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from room2dgs.captures.uncertainty import aligned_weight
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.state import DepthSettings, DepthState


def store_aligned(state: DepthState, settings: DepthSettings) -> DepthState:
    """Store what no later stage takes; maps that are off the points that their own photo sees weigh less."""
    if state.depth_settings.joint and state.depths and not len(state.samples):
        settings.log("depth prior: no point holds it, so it is used as it is, neither optimised jointly nor completed")
    weights = state.depth_weights()
    for name, depth in state.depths.items():
        state.put_depth(name, depth, _by_fit(depth, weights.get(name), state.fits.get(name)))
    return replace(state, depths={})


def _by_fit(depth: np.ndarray, weight: np.ndarray | None, fit: Fit | None) -> np.ndarray | None:
    if fit is None or not np.isfinite(fit.residual):
        return weight
    return aligned_weight(fit.residual) * (np.ones(depth.shape, np.float32) if weight is None else weight)
