"""Corrections propagated to views without tracks from the views before and after them.

The pose of a tracked, hand-held camera drifts, so corrections of neighbouring views are similar. How similar is
measured on the views whose corrections are known; where they are independent, nothing is propagated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import pose_at

LEAST_COMPARED = 8  # views whose corrections are compared with those of others, for these to be believed


class Propagated(NamedTuple):
    """All cameras after propagation.

    Attributes:
        cameras: the adjusted cameras, and the others with propagated corrections where there are any.
        remaining: (V,) expected share of the given rotation error that remains: 0 for adjusted views, 1 where nothing
            was propagated.
    """

    cameras: list[Camera]
    remaining: np.ndarray


def propagated(cameras: Sequence[Camera], given: Sequence[Camera], known: np.ndarray) -> Propagated:
    """Correct the views that were not adjusted as their neighbours were, where corrections predict each other.

    Args:
        cameras: in capture order; adjusted where they are known, as given elsewhere.
        given: the same with the given poses.
        known: (V,) bool.
    """
    corrections = np.stack([_correction(*both) for both in zip(cameras, given, strict=True)])
    index = np.flatnonzero(known)

    @cache
    def alike(gap: int) -> tuple[np.ndarray, float]:
        return _alike(corrections, known, gap)

    found, remaining = list(cameras), np.where(known, 0.0, 1.0)
    for view in np.flatnonzero(~known):
        before, after = index[index < view], index[index > view]
        ends = [*before[-1:], *after[:1]]
        if not ends:
            continue
        share, remaining[view] = alike(int(min(abs(end - view) for end in ends)))
        nearness = np.array([1 / abs(end - view) for end in ends])
        between = nearness @ corrections[ends] / nearness.sum()
        if share.any():
            found[view] = _corrected(given[int(view)], share * between)
    return Propagated(found, remaining)


def _alike(corrections: np.ndarray, known: np.ndarray, gap: int) -> tuple[np.ndarray, float]:
    """(6,) how much of the mean of the corrections so many views before and after a view is its own correction, 0..1,
    and the share of a rotation's error that remains then."""
    middle = np.arange(gap, len(known) - gap)
    middle = middle[known[middle] & known[middle - gap] & known[middle + gap]]
    if len(middle) < LEAST_COMPARED:
        return np.zeros(6), 1.0
    own, mean = corrections[middle], (corrections[middle - gap] + corrections[middle + gap]) / 2
    shares = np.zeros(6)
    for part in (slice(0, 3), slice(3, 6)):  # rotations and centres
        square = np.sum(mean[:, part] ** 2)
        shares[part] = np.clip(np.sum(own[:, part] * mean[:, part]) / square, 0, 1) if square > 0 else 0
    rest = np.sum((own - shares * mean)[:, :3] ** 2) / max(np.sum(own[:, :3] ** 2), 1e-30)
    return shares, float(np.sqrt(min(rest, 1.0)))


def _correction(camera: Camera, given: Camera) -> np.ndarray:
    """(6,) rotation vector in the world, and the way of the centre."""
    turn = Rotation.from_matrix(camera.rotation.T @ given.rotation).as_rotvec()
    return np.concatenate([turn, camera.centre - given.centre])


def _corrected(given: Camera, correction: np.ndarray) -> Camera:
    turn = Rotation.from_rotvec(correction[:3]).as_matrix()
    pose = pose_at(given.rotation @ turn.T, given.centre + correction[3:])
    return replace(given, cam_from_world=pose)
