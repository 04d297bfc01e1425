"""Tells wrong poses from photos whose matches are too few or too wrong to judge poses by.

Few matches near the epipolar lines of the poses mean either wrong poses or wrong matches (little overlap, repeated
patterns). So poses are judged only by matches that are inliers of an essential matrix of their own: with right poses
nearly all of these fit, with wrong poses few. Cameras in one place have no epipolar lines; there a match has to lie
where the rotation takes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.colmap import pycolmap
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.matching import Matches, epipolar_error, essential_inliers
from room2dgs.sfm.pairs import MIN_BASELINE_M

MOST_PAIRS = 24  # those with most matches
OWN_SHARE, OWN_MATCHES = 0.5, 30  # inliers of a pair's essential matrix: fewer may be chance
MAX_PX = 2.0
TRIALS = 500  # of five matches: enough where half of them are right
ENOUGH = 200  # matches to judge by
MIN_INLIER_SHARE = 0.5


class Verdict(NamedTuple):
    """How well the poses fit the matches that are inliers of an essential matrix of their own.

    Attributes:
        matches: their number.
        inlier_share: share of them that fits the poses; NaN without any.
    """

    matches: int
    inlier_share: float

    @property
    def confirmed(self) -> bool:
        """The photos confirm the poses."""
        return self.matches >= ENOUGH and self.inlier_share >= MIN_INLIER_SHARE

    @property
    def contradicted(self) -> bool:
        """The photos contradict the poses. With too few matches, neither this nor `confirmed` is true."""
        return self.matches >= ENOUGH and self.inlier_share < MIN_INLIER_SHARE


def verdict(matches: Matches, cameras: Sequence[Camera], pairs: Iterable[tuple[int, int]]) -> Verdict:
    """Judge poses by the pairs with most matches; the same input gives the same answer."""
    known = [pair for pair in pairs if pair in matches.of_pair]
    best_matched = sorted(known, key=lambda pair: -len(matches.of_pair[pair]))[:MOST_PAIRS]
    count = inliers = 0
    for i, j in best_matched:
        first, second = matches.pixels((i, j))
        own = _own_geometry(cameras[i], cameras[j], first, second)
        count += int(own.sum())
        inliers += int((own & (pose_error(cameras[i], cameras[j], first, second) <= MAX_PX)).sum())
    return Verdict(count, inliers / count if count else float("nan"))


def pose_error(first: Camera, second: Camera, first_px: np.ndarray, second_px: np.ndarray) -> np.ndarray:
    """(M,) errors of matches (M, 2) under two posed cameras, pixels.

    The Sampson distance; for cameras in one place the distance to where the rotation takes the pixel, infinite where
    that is behind the camera.
    """
    if np.linalg.norm(first.centre - second.centre) > MIN_BASELINE_M:
        return epipolar_error(first, second, first_px, second_px)
    # any depth will do
    pixel, depth = second.project(second.centre + first.unproject(first_px, np.ones(len(first_px))) - first.centre)
    return np.where(depth > 0, np.linalg.norm(pixel - second_px, axis=1), np.inf)


def _own_geometry(first: Camera, second: Camera, first_px: np.ndarray, second_px: np.ndarray) -> np.ndarray:
    """(M,) bool: inliers of the essential matrix that fits most matches, whatever the poses; none if these are few.

    A pure rotation is no special case: any translation direction explains it.
    """
    nothing = np.zeros(len(first_px), bool)
    if len(first_px) < OWN_MATCHES:
        return nothing
    options = pycolmap.RANSACOptions(min_num_trials=1, max_num_trials=TRIALS, max_error=MAX_PX, random_seed=0)
    own = essential_inliers(first, second, first_px, second_px, options)
    return own if own.sum() >= max(OWN_MATCHES, OWN_SHARE * len(own)) else nothing
