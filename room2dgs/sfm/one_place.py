"""Whether all photos were taken from one place by their poses, so that there is no parallax."""

from __future__ import annotations

import numpy as np

from room2dgs.captures.scene import Scene
from room2dgs.captures.seen_points import seen_points
from room2dgs.errors import InputError

ONE_PLACE_M = 0.05  # cameras nearer to each other than that, all of them, see no depth in a room
ONE_PLACE_OF_DEPTH = 1 / 60  # and that share of the depth that they see, where lengths are no metres
WALK = "walk while filming, do not only turn"  # advice for such a capture, and for no other
MOST_VIEWS = 12  # views


def in_one_place(scene: Scene) -> bool:
    """By how far apart the training cameras stand: in metres, or in a capture's own unit beside its points' depth."""
    depth = None if scene.metric else _depth(scene)
    return reach(scene) < (ONE_PLACE_M if depth is None else ONE_PLACE_OF_DEPTH * depth)


def reach(scene: Scene) -> float:
    """Diagonal of the box around the training cameras, in the scene's unit."""
    return float(np.linalg.norm(np.ptp([frame.camera.centre for frame in scene.train], axis=0)))


def _depth(scene: Scene) -> float | None:
    """Median depth of the points that the capture brings; None where it brings none."""
    if scene.given_points is None:
        return None
    try:
        points = scene.given_points()
    except InputError:  # who uses the points tells
        return None
    depths = [seen_points(points, frame).depth for frame in scene.train[:: max(1, len(scene.train) // MOST_VIEWS)]]
    found = np.concatenate(depths)
    return float(np.median(found)) if len(found) else None
