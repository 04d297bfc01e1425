"""Culling to what the cameras saw, the only part of a mesh that is scored.

A point of a mesh is *observed* if at least one camera
1. has it inside its image and at least NEAR_M in front,
2. has a ground truth along the ray to it: where the true mesh has no surface at all (a window, an open door)
   nothing is known, so nothing is judged, and
3. sees it. That is: the point lies in front of the true surface, up to TOLERANCE_M behind it (space that the
   camera knows to be empty: a floater is judged even where another floater hides it), or it is the first
   surface of its own mesh along the ray, up to TOLERANCE_M (a wall that stands too far back is judged, junk
   hidden behind a wall is not).

Rays are cast to the points themselves, so no image resolution enters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import NEAR_M, Camera

TOLERANCE_M = 0.02  # so much nearer may the first hit of a ray be without hiding the point


def sees(points: np.ndarray, camera: Camera, own: Surface, truth: Surface) -> np.ndarray:
    """(N,) bool: does this camera observe the points (the module's three conditions)?

    Args:
        points: (N, 3) metres, world; on the mesh of `own`.
        own: the mesh that the points belong to.
        truth: the ground truth (`own` itself, for the ground truth's points).
    """
    seen = camera.in_view(points, NEAR_M)
    inside = np.flatnonzero(seen)
    rays = points[inside] - camera.centre
    distance = np.linalg.norm(rays, axis=1)
    to_truth = truth.cast(camera.centre, rays).t * distance
    known = np.isfinite(to_truth)
    good = known & (distance <= to_truth + TOLERANCE_M)
    unsure = np.flatnonzero(known & ~good)
    if own is not truth and len(unsure):
        to_own = own.cast(camera.centre, rays[unsure]).t * distance[unsure]
        good[unsure] = distance[unsure] <= to_own + TOLERANCE_M
    seen[inside] = good
    return seen


def first_view(points: np.ndarray, cameras: Sequence[Camera], own: Surface, truth: Surface) -> np.ndarray:
    """(N,) int64 index of the first camera that observes each point, -1 where none does."""
    view = np.full(len(points), -1, dtype=np.int64)
    open_ = np.arange(len(points))
    for index, camera in enumerate(cameras):
        seen = sees(points[open_], camera, own, truth)
        view[open_[seen]] = index
        open_ = open_[~seen]
        if not len(open_):
            break
    return view


def count_views(points: np.ndarray, cameras: Sequence[Camera], own: Surface, truth: Surface) -> np.ndarray:
    """(N,) int64 number of cameras that observe each point."""
    count = np.zeros(len(points), dtype=np.int64)
    for camera in cameras:
        count += sees(points, camera, own, truth)
    return count
