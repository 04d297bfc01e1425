"""Where stereo matched the surface of a run, and where its depth comes from between its samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.runs.trust import Trust

SHOWN_M, SHOWN = 0.05, 0.02  # from a view's depth, and as a share of it, within which the view shows a place


def matched_views(points: np.ndarray, frames: Iterable[Frame], trust: Mapping[str, Trust]) -> np.ndarray:
    """(N,) int: in how many views stereo found the same, of the view that shows a point and knows most; 0: in none.

    Where it is 0, what the view's depth there rests on lies elsewhere: networks and planes, or a depth camera.

    Args:
        points: (N, 3) metres, the scene's frame.
        frames: training views.
        trust: frame name -> small maps of the run; views without depth in them are passed over.
    """
    most = np.zeros(len(points), np.int64)
    for frame in frames:
        maps = trust.get(frame.name)
        if maps is None or maps.depth is None:
            continue
        height, width = maps.depth.shape
        camera = frame.camera.resized(width, height)
        number, column, row, z = camera.pixels_of(points)
        depth = maps.depth[row, column].astype(np.float64)
        shown = (depth > 0) & (np.abs(depth - z) < np.maximum(SHOWN_M, SHOWN * z))
        most[number[shown]] = np.maximum(most[number[shown]], maps.num_consistent[row, column][shown])
    return most
