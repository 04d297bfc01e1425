"""What other views are sure of, as seen by each view: depth to draw it to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs import _C
from room2dgs.captures.uncertainty import completed_weight
from room2dgs.depth.completion.low_res import Completed
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.patchmatch import warp

LENDING = 20  # other views
SURE = 0.2  # weight above which a pixel is projected
SAME = 0.02  # relative difference from the votes' median up to which a vote counts


class LendingView(NamedTuple):
    """One view's depth as other views get it.

    Attributes:
        camera: of its size.
        depth: (h, w) float32 metres, 0 = unknown.
        weight: (h, w) float32, 0..1.
    """

    camera: Camera
    depth: np.ndarray
    weight: np.ndarray


def lent_depth(
    views: Sequence[Completed], sigmas: Sequence[np.ndarray], near: Sequence[np.ndarray | Sequence[int]]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """`depth_of_other_views` of completed views, each by the (h, w) sigma that is expected of it."""
    lending = [
        LendingView(view.camera, view.depth, completed_weight(sigma)) for view, sigma in zip(views, sigmas, strict=True)
    ]
    return depth_of_other_views(lending, near)


def depth_of_other_views(
    views: Sequence[LendingView], near: Sequence[np.ndarray | Sequence[int]]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Depth of each view made of its neighbours' alone.

    Pixels of the neighbours above `SURE` are projected. Each neighbour has one vote a pixel: the mean depth of what
    falls there by weight, with its mean weight. The weighted median of the votes chooses those within
    `SAME` of it; their mean is the depth. Views that see a place from elsewhere than those that guess it wrongly are
    heard, as in fusion of depth maps by visibility (Merrell et al. 2007), here before depth is completed.

    Args:
        views: all of them; their sizes may differ.
        near: for each, the others that lend it depth, best first; no more than `LENDING` do.

    Returns:
        For each view (h, w) float32 metres, 0 = none, and its weight, 0..1: mean weight, times the share of the votes
        within `SAME`, times s / (s + 1), s the sum of their weights.
    """
    if not views:
        return []
    near = [list(others)[:LENDING] for others in near]
    listed = np.full((len(views), max(1, *map(len, near))), -1, np.int64)
    warps = np.zeros((*listed.shape, 3, 4))
    for view, others in enumerate(near):
        listed[view, : len(others)] = others
        for slot, other in enumerate(others):
            warps[view, slot] = warp(views[other].camera, views[view].camera)
    size = np.array([view.depth.shape for view in views], np.int64)
    depth = np.concatenate([view.depth.ravel() for view in views], dtype=np.float32)
    weight = np.concatenate([view.weight.ravel() for view in views], dtype=np.float32)
    found, found_weight = np.empty_like(depth), np.empty_like(depth)
    _C.depth_of_other_views(depth, weight, size, listed, warps, SURE, SAME, found, found_weight)
    ends = np.cumsum(size.prod(axis=1))[:-1]
    parts = zip(np.split(found, ends), np.split(found_weight, ends), size, strict=True)
    return [(own.reshape(shape), of.reshape(shape)) for own, of, shape in parts]
