"""Which photos to match with which, from their known poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import MIN_SHARED, shared_view

# Two views from one place triangulate nothing.
MIN_BASELINE_M = 1e-3


def match_pairs(cameras: Sequence[Camera], overlap: int) -> list[tuple[int, int]]:
    """Pairs to match: half of `overlap` successors in capture order, and half chosen by pose.

    Successors carry tracks along the path; the ones chosen by pose give parallax and close loops.

    Returns:
        Sorted index pairs (i, j), i < j, each once and with a baseline; at most `overlap` times N of them.
    """
    count = len(cameras)
    half = (overlap + 1) // 2
    pairs = {(i, j) for i in range(count) for j in range(i + 1, min(i + half + 1, count))}
    score = shared_view(cameras)
    for i in range(count):
        best = np.argsort(-score[i], kind="stable")[: overlap - half]
        pairs |= {(min(i, int(j)), max(i, int(j))) for j in best if score[i, j] > MIN_SHARED}
    centres = np.stack([camera.centre for camera in cameras])
    return [(i, j) for i, j in sorted(pairs) if np.linalg.norm(centres[i] - centres[j]) > MIN_BASELINE_M]
