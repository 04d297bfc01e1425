"""The scale of metric poses, from their extent and from the ways between them, each by what it is worth.

A tracker's centres drift apart by centimetres a metre and jump at relocalisations, so the extent of a whole walk is off
by percents. Stretches of half a metre are known better, and the errors of many cancel. Where errors are independent of
each other, it is the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.geometry.camera import Camera

STRETCH_M = 0.5  # 0.3 to 1.2 are alike; drift alone would want shorter ones, independent errors longer ones
LEAST_STRETCHES = 8
STEPS = 10
LOSS = 2.0  # times the middle difference: beyond it a row counts little, such as a stretch with a jump
MOST_ALIKE = 0.99


class Regression(NamedTuple):
    """A factor between vectors, and its variance."""

    scale: float
    variance: float


def common_scale(cameras: Sequence[Camera], given: Sequence[Camera]) -> float:
    """The factor that gives the cameras the size of the given ones, whose frame they are in.

    Args:
        cameras, given: in the order in which they were walked, metres; the former turned to the latter.
    """
    want, found = (np.stack([one.centre for one in some]) for some in (given, cameras))
    both = [regression(want - want.mean(axis=0), found - found.mean(axis=0)), motion_scale(cameras, given)]
    known = [one for one in both if one is not None]
    if any(one.variance == 0 for one in known):
        return next(one.scale for one in known if one.variance == 0)
    weight = [1 / one.variance for one in known]
    return sum(w * one.scale for w, one in zip(weight, known, strict=True)) / sum(weight) if known else 1.0


def motion_scale(cameras: Sequence[Camera], given: Sequence[Camera]) -> Regression | None:
    """By what ways between cameras have to be multiplied to be as long as between given ones.

    A stretch joins each camera to the first one that is half a metre of the given walk later. Given ones are regressed
    on found ones, each in the frame of its first camera.

    Returns:
        None where there are few stretches.
    """
    centre = np.stack([one.centre for one in given])
    walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centre, axis=0), axis=1))])
    second = np.searchsorted(walked, walked + STRETCH_M)
    first = np.flatnonzero(second < len(given))
    if len(first) < LEAST_STRETCHES:
        return None
    want, found = (_ways(some, first, second[first]) for some in (given, cameras))
    return regression(want, found)


def regression(want: np.ndarray, found: np.ndarray) -> Regression | None:
    """The factor of `found` that is nearest to `want` under Cauchy's loss; None where all of `found` is zero.

    The variance counts the likeness of neighbouring rows' errors, as an autoregression of first order.

    Args:
        want, found: (N, 3) in the order of time.
    """
    square = np.sum(found**2, axis=1)
    if not square.any():
        return None
    weight, scale, off = np.ones(len(want)), 1.0, want - found
    for _ in range(STEPS):
        scale = float(np.sum(weight[:, None] * want * found) / np.sum(weight * square))
        off = want - scale * found
        distance = np.linalg.norm(off, axis=1)
        weight = 1 / (1 + (distance / max(LOSS * float(np.median(distance)), 1e-12)) ** 2)
    pull = weight * np.sum(off * found, axis=1)
    total = float(np.sum(pull**2))
    alike = float(np.sum(pull[1:] * pull[:-1])) / max(total, 1e-300)
    alike += (1 + 3 * alike) / len(pull)  # Kendall's: what such a short series takes from it
    alike = min(max(alike, 0.0), MOST_ALIKE)
    return Regression(scale, total * (1 + alike) / (1 - alike) / float(np.sum(weight * square)) ** 2)


def _ways(cameras: Sequence[Camera], first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(N, 3) metres from cameras to later ones, in the frame of the former."""
    rotation, centre = np.stack([one.rotation for one in cameras]), np.stack([one.centre for one in cameras])
    return np.asarray(np.einsum("nab,nb->na", rotation[first], centre[second] - centre[first]))
