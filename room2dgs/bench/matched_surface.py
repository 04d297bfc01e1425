"""Where stereo matched the surface of a run, and where its depth comes from between its samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.runs.trust import Trust

SHOWN_M, SHOWN = 0.05, 0.02  # from a view's depth, and as a share of it, within which the view shows a place


class Matched(NamedTuple):
    """What the depth of N places rests on.

    Attributes:
        views: (N,) int, in how many views stereo found the same, of the view that shows a place and knows most; 0: in
            none. What the depth there rests on lies elsewhere then: networks, a depth camera, or the planes.
        on_plane: (N,) bool, where a view that shows it has it on one of the room's planes.
    """

    views: np.ndarray
    on_plane: np.ndarray


def matched_views(points: np.ndarray, frames: Iterable[Frame], trust: Mapping[str, Trust]) -> Matched:
    """What stereo and planes know of points.

    Args:
        points: (N, 3) metres, the scene's frame.
        frames: training views.
        trust: frame name -> small maps of the run; views without depth in them are passed over.
    """
    most, flat = np.zeros(len(points), np.int64), np.zeros(len(points), bool)
    for frame in frames:
        maps = trust.get(frame.name)
        if maps is None or maps.depth is None:
            continue
        height, width = maps.depth.shape
        camera = frame.camera.resized(width, height)
        number, column, row, z = camera.pixels_of(points)
        depth = maps.depth[row, column].astype(np.float64)
        shown = (depth > 0) & (np.abs(depth - z) < np.maximum(SHOWN_M, SHOWN * z))
        number, row, column = number[shown], row[shown], column[shown]
        most[number] = np.maximum(most[number], maps.num_consistent[row, column])
        if maps.on_plane is not None:
            flat[number] |= maps.on_plane[row, column] > 0
    return Matched(most, flat)
