"""Every view's depth as the network corrects it, from all that speaks for it and against it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs import _C
from room2dgs.depth.completion.correction import Correct
from room2dgs.depth.completion.evidence import evidence
from room2dgs.depth.completion.expected_sigma import comparing, expecting
from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.low_res import Completed, rescaled
from room2dgs.depth.completion.on_planes import on_planes
from room2dgs.depth.completion.other_views import lent_depth
from room2dgs.depth.completion.planes import Plane
from room2dgs.depth.completion.views import LowResViews
from room2dgs.parallel_map import parallel_map


def corrected(
    views: LowResViews, space: FreeSpace | None, planes: Sequence[Plane], correct: Correct
) -> tuple[list[Completed], list[np.ndarray]]:
    """What the network makes of each view, and the (h, w) relative standard deviations that it expects then.

    Args:
        space: as `expecting` takes it.
        planes: the room's.
    """
    numbers = range(len(views.frames))
    expected = expecting(views.together, views.alone, views.near, space)
    sigmas = list(parallel_map(expected, numbers, _C.threads()))
    lent = lent_depth(views.alone, sigmas, views.near)
    compared = comparing(views.alone, views.near)

    def one(view: int) -> tuple[Completed, np.ndarray]:
        given, part = views.inputs[view], views.together[view]
        through = seen_through(space, part.camera.unproject_map(part.depth))
        found = on_planes(part.depth, given.normal, given.camera, planes)
        consistency = compared(view, part.depth)
        on = (found.depth, found.weight)
        channels = evidence(given, part, consistency, through, lent[view], on, sigmas[view])
        log_factor, sigma = correct(views.frames[view].name, channels)
        return rescaled(part, log_factor), sigma

    found = list(parallel_map(one, numbers, _C.threads()))
    return [part for part, _ in found], [sigma for _, sigma in found]
