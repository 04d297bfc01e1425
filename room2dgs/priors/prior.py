"""What the losses see of a frame's priors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Prior(NamedTuple):
    """Maps of one frame at its camera's size; a pair is None where the frame has no such prior.

    Attributes:
        depth: (H, W) float32 z-depth in metres, aligned to the sparse points; 0 = invalid.
        depth_valid: (H, W) bool.
        normal: (H, W, 3) float32, unit, world frame, facing the camera; 0 = invalid.
        normal_valid: (H, W) bool.
        depth_weight, normal_weight: (H, W) float32 in 0..1, how far the losses believe each pixel; None: 1 everywhere.
    """

    depth: np.ndarray | None = None
    depth_valid: np.ndarray | None = None
    normal: np.ndarray | None = None
    normal_valid: np.ndarray | None = None
    depth_weight: np.ndarray | None = None
    normal_weight: np.ndarray | None = None
