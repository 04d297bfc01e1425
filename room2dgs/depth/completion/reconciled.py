"""Depth of all views after the network has corrected each by itself: neighbours and planes make it one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.captures.uncertainty import completed_sigma
from room2dgs.depth.completion.low_res import Completed, LowResInput, rescaled
from room2dgs.depth.completion.on_planes import flattened
from room2dgs.depth.completion.other_views import lent_depth
from room2dgs.depth.completion.planes import Plane

APART = 3.0  # expected errors of both between two depths at which half of what they differ by counts
SURE_ENOUGH = 2.0  # times a pixel's expected error, that of the others up to which their disagreement tells on it
LEAST_WEIGHT, MOST_WEIGHT = 1e-3, 0.9999


def with_neighbours(
    parts: Sequence[Completed], errors: Sequence[np.ndarray], near: Sequence[np.ndarray | Sequence[int]]
) -> tuple[list[Completed], list[np.ndarray]]:
    """Each view's depth and its neighbours' word by the inverse squares of their errors, and the errors then.

    ln z moves by d e^2 / (e^2 + o^2) / (1 + d^2 / (APART^2 (e^2 + o^2))), with d = ln of the others' depth over z, o
    their error and e the pixel's. What is left of d adds to e where the others are about as sure: two surfaces that
    are both expected to be right are not.

    Args:
        parts: of all views, each corrected by itself.
        errors: of each, (h, w) relative standard deviation that is expected.
        near: for each, the views to compare it with, best first.
    """
    found, left = [], []
    for part, error, (depth, weight) in zip(parts, errors, lent_depth(parts, errors, near), strict=True):
        both = (depth > 0) & (part.depth > 0)
        away = np.log(np.where(both, depth, 1) / np.where(both, part.depth, 1))
        others = completed_sigma(np.clip(weight, LEAST_WEIGHT, MOST_WEIGHT))
        square = error**2 + others**2
        share = np.where(both, error**2 / square, 0) / (1 + away**2 / (APART**2 * square))
        found.append(rescaled(part, share * away))
        tells = both & (others < SURE_ENOUGH * error)
        left.append(np.hypot(error, np.where(tells, (1 - share) * away, 0)).astype(np.float32))
    return found, left


def on_their_planes(
    given: Sequence[LowResInput], parts: Sequence[Completed], errors: Sequence[np.ndarray], planes: Sequence[Plane]
) -> list[Completed]:
    """What almost lies on a plane lies on it, if that is not many expected errors away.

    Args:
        given: of all views; their normals.
        parts, errors: as `with_neighbours` gives them.
    """
    return [
        rescaled(part, flattened(part.depth, maps.normal, maps.camera, planes, error)[0])
        for maps, part, error in zip(given, parts, errors, strict=True)
    ]
