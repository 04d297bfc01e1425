"""The oracle of `depth_of_other_views` in numpy, one view at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.depth.completion.other_views import LENDING, SAME, SURE, LendingView
from room2dgs.stereo.patchmatch import warp


def depth_of_other_views_reference(
    views: Sequence[LendingView], view: int, others: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) float64 depth and trust of one view."""
    shape = views[view].depth.shape
    votes = [_vote(views[other], views[view]) for other in list(others)[:LENDING]]
    if not votes:
        return np.zeros(shape), np.zeros(shape)
    z, weight = (np.stack(part) for part in zip(*votes, strict=True))
    order = np.argsort(np.where(weight > 0, z, np.inf), axis=0, kind="stable")
    z, weight = (np.take_along_axis(part, order, axis=0) for part in (z, weight))
    total = weight.sum(axis=0)
    middle = (np.cumsum(weight, axis=0) >= total / 2).argmax(axis=0)
    median = np.take_along_axis(z, middle[None], axis=0)[0]
    consistent = np.where(np.abs(z - median) < SAME * median, weight, 0)
    s = consistent.sum(axis=0)
    some = np.where(s > 0, s, 1)
    trust = (consistent**2).sum(axis=0) / some * (s / np.where(s > 0, total, 1)) * (s / (s + 1))
    return (consistent * z).sum(axis=0) / some, trust


def _vote(other: LendingView, view: LendingView) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) depth and weight, 0 where nothing of the other view falls."""
    height, width = view.depth.shape
    row, column = np.nonzero((other.depth > 0) & (other.weight > SURE))
    depth, sure = (part[row, column].astype(np.float64) for part in (other.depth, other.weight))
    matrix = warp(other.camera, view.camera)
    x, y, z = depth * (matrix[:, :3] @ [column, row, np.ones(len(row))]) + matrix[:, 3:]
    ahead = z > 1e-6
    u, v = (np.divide(part, z, out=np.full(len(z), -9.0), where=ahead) for part in (x, y))
    inside = (u > -0.5) & (u < width - 0.5) & (v > -0.5) & (v < height - 0.5)
    pixel = (np.rint(v[inside]) * width + np.rint(u[inside])).astype(np.int64)
    sums = [np.bincount(pixel, part[inside], width * height) for part in (sure, sure * z)]
    met = np.bincount(pixel, minlength=width * height)
    there = np.maximum(met, 1)
    mean = np.divide(sums[1], sums[0], out=np.zeros(len(met)), where=sums[0] > 0)
    return mean.reshape(height, width), (sums[0] / there).reshape(height, width)
