"""Which views each view is compared with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.config import MultiviewConfig
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.pairs import shared_view

LEAST_SHARED = 0.1  # of `shared_view`: views that see less in common have few pixels to compare


def neighbours(cameras: Sequence[Camera], config: MultiviewConfig) -> list[np.ndarray]:
    """Each view's neighbours, best first by what both see and triangulate (`shared_view`).

    Neighbours look in nearly the same direction, from another place that is not too far away; there may be none, as
    for cameras that only turn.

    Returns:
        one array of indices a camera, of at most `config.neighbours`.
    """
    centres = np.stack([camera.centre for camera in cameras])
    axes = np.stack([camera.forward for camera in cameras])
    baseline = np.linalg.norm(centres[:, None] - centres, axis=-1)
    angle = np.degrees(np.arccos((axes @ axes.T).clip(-1.0, 1.0)))
    score = shared_view(cameras)
    fits = (baseline >= config.min_baseline_m) & (baseline <= config.max_baseline_m)
    fits &= (angle < config.max_angle_deg) & (score >= LEAST_SHARED)
    best = np.argsort(np.where(fits, -score, np.inf), axis=1, kind="stable")[:, : config.neighbours]
    return [row[fits[view, row]] for view, row in enumerate(best)]
