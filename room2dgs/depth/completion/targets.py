"""What completed depth is drawn to when it is completed again: the room's planes, and what other views are sure of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.depth.completion.on_planes import on_planes
from room2dgs.depth.completion.other_views import lent_depth
from room2dgs.depth.completion.planes import Plane


def drawn_to_planes(
    view: LowResInput, before: Completed, planes: Sequence[Plane], space: FreeSpace | None
) -> LowResInput:
    """What to complete once more: a plane is a sample wherever it weighs more than stereo's, and where other views
    look through what was found, the prior counts for nothing."""
    through = seen_through(space, view.camera.unproject_map(before.depth))
    view = view._replace(prior_weight=(view.prior_weight * (1 - through) ** 2).astype(np.float32))
    found = on_planes(before.depth, view.normal, view.camera, planes)
    return _with_samples(view, found.depth, found.weight)


def drawn_to_other_views(
    inputs: Sequence[LowResInput],
    before: Sequence[Completed],
    sigmas: Sequence[np.ndarray],
    near: Sequence[np.ndarray | Sequence[int]],
) -> Iterator[LowResInput]:
    """Likewise what a view's neighbours are sure of; each made when it is needed."""
    lent = lent_depth(before, sigmas, near)
    return (_with_samples(view, *seen) for view, seen in zip(inputs, lent, strict=True))


def _with_samples(view: LowResInput, depth: np.ndarray, weight: np.ndarray) -> LowResInput:
    """With these samples wherever they weigh more than what there is."""
    use = weight > view.sample_weight
    sample, weight = np.where(use, depth, view.sample), np.where(use, weight, view.sample_weight)
    return view._replace(sample=sample.astype(np.float32), sample_weight=weight.astype(np.float32))
