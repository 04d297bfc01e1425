"""The room's planes in the completed depth of all views, refined at the creases that photos see."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial

import cv2
import numpy as np

from room2dgs.captures.uncertainty import completed_weight
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.completion.creases import SeenPlanes
from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.depth.completion.on_planes import on_planes
from room2dgs.depth.completion.plane_refinement import refined_at_creases
from room2dgs.depth.completion.planes import Plane, Samples, find_planes
from room2dgs.depth.completion.views import LowResViews

CORRECTED = 0.5  # of the distance at which a sample starts to count as off a plane, for corrected depth
LEAST_SEEN = 0.2  # weight of a plane in a pixel, for the plane's creases
LEAST_SURE = 0.3  # weight of a pixel that takes part in finding planes


def planes_in(
    views: LowResViews,
    sigmas: Sequence[np.ndarray],
    space: FreeSpace | None,
    settings: DepthPriorConfig,
    pool: Executor,
    width: float = 1.0,
) -> list[Plane]:
    """Planes of all views' depth together, the largest first.

    Args:
        sigmas: (h, w) of each view's depth.
        width: as `find_planes`.
    """
    samples = samples_of(views.inputs, views.together, sigmas, space)
    planes = find_planes(samples, right_angles=settings.right_angles, width=width)
    if settings.creases:
        seen = list(pool.map(partial(_seen_planes, planes=planes), views.inputs, views.together))
        planes = refined_at_creases(planes, seen)
    return planes


def samples_of(
    inputs: Sequence[LowResInput], views: Sequence[Completed], sigmas: Sequence[np.ndarray], space: FreeSpace | None
) -> Samples:
    """Every other pixel of every other row of the views whose normals are known, where the depth weighs enough."""
    parts = []
    for given, view, sigma in zip(inputs, views, sigmas, strict=True):
        row, column = (one.ravel() for one in np.mgrid[1 : view.depth.shape[0] : 2, 1 : view.depth.shape[1] : 2])
        depth, normal, sure = view.depth[row, column], given.normal[row, column], completed_weight(sigma[row, column])
        use = (depth > 0) & (sure > LEAST_SURE) & normal.any(axis=1)
        pixel = np.stack([column, row], axis=1)[use] + 0.5
        xyz = view.camera.unproject(pixel, depth[use])
        weight = sure[use] * depth[use] ** 2 * (1 - seen_through(space, xyz)) ** 2
        off = sigma[row, column][use] * depth[use]
        parts.append(Samples(xyz, normal[use], depth[use], weight, off))
    return Samples(*(np.concatenate(one) for one in zip(*parts, strict=True)))


def _seen_planes(given: LowResInput, view: Completed, planes: Sequence[Plane]) -> SeenPlanes:
    found = on_planes(view.depth, given.normal, given.camera, planes)
    grey = cv2.cvtColor(given.photo, cv2.COLOR_RGB2GRAY)
    which = np.where(found.weight < LEAST_SEEN, -1, found.which)
    return SeenPlanes(view.camera, grey, which, given.sample, given.sample_weight)
