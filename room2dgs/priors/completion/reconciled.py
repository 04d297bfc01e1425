"""Depth of all views after the network has corrected each by itself: neighbours and planes make it one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.priors.completion.expected_error import confidence, error_of
from room2dgs.priors.completion.on_planes import FLAT, on_planes
from room2dgs.priors.completion.other_views import SureView, depth_of_other_views
from room2dgs.priors.completion.planes import Plane
from room2dgs.priors.completion.small_maps import Completed, SmallMaps

APART = 3.0  # expected errors of both between two depths at which half of what they differ by counts
SURE_ENOUGH = 2.0  # times a pixel's expected error, that of the others up to which their disagreement tells on it
LEAST_TRUST, MOST_TRUST = 1e-3, 0.9999
FROM_PLANE = 2.0  # expected errors between a depth and a plane at which it goes half of the way
LEAST_ERROR = 1e-4


def with_neighbours(
    parts: Sequence[Completed], errors: Sequence[np.ndarray], near: Sequence[Sequence[int]]
) -> tuple[list[Completed], list[np.ndarray]]:
    """Each view's depth and its neighbours' word by the inverse squares of their errors, and the errors then.

    ln z moves by d e^2 / (e^2 + o^2) / (1 + d^2 / (APART^2 (e^2 + o^2))), with d = ln of the others' depth over z, o
    their error and e the pixel's. What is left of d adds to e where the others are about as sure: two surfaces that
    are both expected to be right are not.

    Args:
        parts: of all views, each corrected by itself.
        errors: of each, (h, w) expected relative error.
        near: for each, which others to ask, best first (`depth_of_other_views`).
    """
    sure = [SureView(part.camera, part.depth, confidence(error)) for part, error in zip(parts, errors, strict=True)]
    found, left = [], []
    for part, error, (depth, trust) in zip(parts, errors, depth_of_other_views(sure, near), strict=True):
        both = (depth > 0) & (part.depth > 0)
        away = np.log(np.where(both, depth, 1) / np.where(both, part.depth, 1))
        others = error_of(np.clip(trust, LEAST_TRUST, MOST_TRUST))
        square = error**2 + others**2
        share = np.where(both, error**2 / square, 0) / (1 + away**2 / (APART**2 * square))
        found.append(_moved(part, share * away))
        tells = both & (others < SURE_ENOUGH * error)
        left.append(np.hypot(error, np.where(tells, (1 - share) * away, 0)).astype(np.float32))
    return found, left


def on_their_planes(
    given: Sequence[SmallMaps], parts: Sequence[Completed], errors: Sequence[np.ndarray], planes: Sequence[Plane]
) -> list[Completed]:
    """What almost lies on a plane lies on it, if that is not many expected errors away.

    Args:
        given: of all views; their normals.
        parts, errors: as `with_neighbours` gives them.
    """
    found = []
    for maps, part, error in zip(given, parts, errors, strict=True):
        depth, share = on_planes(part.depth, maps.normal, maps.camera, planes, FLAT)
        known = share > 0
        away = np.log(np.where(known, depth, 1) / np.where(known, part.depth, 1))
        share = share / (1 + (away / (FROM_PLANE * np.maximum(error, LEAST_ERROR))) ** 2)
        found.append(_moved(part, share * away))
    return found


def _moved(part: Completed, by: np.ndarray) -> Completed:
    by = by.astype(np.float32)
    return part._replace(log_scale=part.log_scale + by, depth=part.depth * np.exp(by))
