"""Every view's depth as the network corrects it, from all that speaks for it and against it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from room2dgs import _C
from room2dgs.captures.uncertainty import completed_weight
from room2dgs.depth.completion.evidence import evidence
from room2dgs.depth.completion.expecting import asking, expecting
from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.on_planes import on_planes
from room2dgs.depth.completion.other_views import SureView, depth_of_other_views
from room2dgs.depth.completion.planes import Plane
from room2dgs.depth.completion.small_maps import Completed, SmallMaps, moved
from room2dgs.parallel_map import parallel_map

CorrectView = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # `Correct` of one view


def corrected(
    given: Sequence[SmallMaps],
    small: Sequence[Completed],
    alone: Sequence[Completed],
    near: Sequence[Sequence[int]],
    space: FreeSpace | None,
    planes: Sequence[Plane],
    corrects: Sequence[CorrectView],
) -> tuple[list[Completed], list[np.ndarray]]:
    """What the network makes of each view, and the (h, w) relative errors that it expects then.

    Args:
        given: what the views were completed from.
        small, alone, near, space: as `expecting` takes them.
        planes: the room's.
        corrects: for each view, what corrects it.
    """
    views = range(len(small))
    errors = list(parallel_map(expecting(small, alone, near, space), views, _C.threads()))
    sure = [
        SureView(part.camera, part.depth, completed_weight(error)) for part, error in zip(alone, errors, strict=True)
    ]
    lent = depth_of_other_views(sure, near)
    asked = asking(alone, near)

    def one(view: int) -> tuple[Completed, np.ndarray]:
        maps, part = given[view], small[view]
        through = seen_through(space, part.camera.unproject_map(part.depth))
        on = on_planes(part.depth, maps.normal, maps.camera, planes)[:2]
        shift, error = corrects[view](
            evidence(maps, part, asked(view, part.depth), through, lent[view], on, errors[view])
        )
        return moved(part, shift), error

    found = list(parallel_map(one, views, _C.threads()))
    return [part for part, _ in found], [error for _, error in found]
