"""Pixels at which normal maps are put to the test: a grid over each view, and where sparse points are seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from room2dgs.captures.seen_points import SeenPoints
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.depth_maps import depth_normals

STRIDE = 8


@dataclass(frozen=True)
class Sample:
    """Some pixels of one frame.

    Attributes:
        raw: (N, 3) normals as in the file.
        rays: (N, 3) camera frame.
        from_depth: (N, 3) normals of the depth prior, camera frame, facing the camera; 0 where there are none.
        camera: of the frame.
        point: (N,) int64, the sparse point that the pixel shows, -1 at the grid's pixels.
    """

    raw: np.ndarray
    rays: np.ndarray
    from_depth: np.ndarray
    camera: Camera
    point: np.ndarray


def sample(raw: np.ndarray, valid: np.ndarray, depth: np.ndarray | None, camera: Camera, seen: SeenPoints) -> Sample:
    """One frame's pixels.

    Args:
        raw: (H, W, 3) unit normals as in the file.
        valid: (H, W) bool.
        depth: (H, W) metres, 0 = invalid; None: no depth prior.
        seen: the sparse points of this view.
    """
    row, column = (part.ravel() for part in np.mgrid[: camera.height : STRIDE, : camera.width : STRIDE])
    seen_column, seen_row = seen.column_row
    point = np.concatenate([np.full(len(row), -1), seen.index])
    row, column = np.concatenate([row, seen_row]), np.concatenate([column, seen_column])
    known = valid[row, column]
    row, column, point = row[known], column[known], point[known]
    from_depth = np.zeros_like(raw) if depth is None else depth_normals(depth, camera, step=2)
    return Sample(raw[row, column], camera.rays()[row, column], from_depth[row, column], camera, point)


def view_pairs(samples: Sequence[Sample], seed: int = 0) -> np.ndarray:
    """Pairs of views of the same points, of all such pairs those between which the camera turned most.

    Where the camera does not turn, every convention agrees with itself.

    Returns:
        (P, 2) int64 into the samples' pixels, one sample's after the other's.
    """
    point = np.concatenate([part.point for part in samples])
    view = np.repeat(np.arange(len(samples)), [len(part.point) for part in samples])
    # each point's views in random order, the next one in line being the other of a pair
    order = np.lexsort((np.random.default_rng(seed).random(len(point)), point))
    order = order[point[order] >= 0]
    pairs = np.stack([order[:-1], order[1:]], axis=1)
    pairs = pairs[point[pairs[:, 0]] == point[pairs[:, 1]]]
    if not len(pairs):
        return pairs
    rotations = np.stack([part.camera.rotation for part in samples])
    trace = np.einsum("pij,pij->p", rotations[view[pairs[:, 0]]], rotations[view[pairs[:, 1]]])
    return pairs[trace <= np.median(trace)]
