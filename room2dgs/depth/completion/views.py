"""All views at the resolution at which their depth is completed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.depth.completion.evidence import CONSISTENCY_VIEWS
from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.depth.completion.other_views import LENDING
from room2dgs.geometry.view_selection import neighbours_by_points


@dataclass(frozen=True)
class LowResViews:
    """Views that have a depth, V of them.

    Attributes:
        frames: of the views.
        inputs: what each is completed from.
        near: for each, the views that see the same, best first.
        alone: what each view finds by itself; other views' depth is no evidence for it.
        together: what all views have made of each other; none before the first completion.
        sigmas: (h, w) relative standard deviation expected of `together`; None: not found yet.
    """

    frames: Sequence[Frame]
    inputs: Sequence[LowResInput]
    near: Sequence[np.ndarray]
    alone: Sequence[Completed] = ()
    together: Sequence[Completed] = ()
    sigmas: Sequence[np.ndarray] | None = None


def near_views(frames: Sequence[Frame], points: PointCloud) -> list[np.ndarray]:
    """For each frame the others that see the same points, best first; of points with tracks, those of two photos."""
    tracked = points if points.tracks is None else points.chosen(points.track_length > 1)
    seen = [seen_points(tracked, frame).index for frame in frames]
    count = max(CONSISTENCY_VIEWS, LENDING)
    return neighbours_by_points([frame.camera for frame in frames], seen, tracked.xyz, count)
