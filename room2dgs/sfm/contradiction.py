"""Whether photos contradict their poses, or only say little about them.

Few matches on the epipolar lines of the poses mean wrong poses or wrong matches: photos that hardly overlap, repeated
patterns. So only matches are asked that a geometry of their own holds together, whatever the poses say: of right poses
nearly all of these agree, of wrong ones few. Cameras that stand in one place have no epipolar lines; there a match has
to lie where the rotation takes it.
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
OWN_SHARE, OWN_MATCHES = 0.5, 30  # of a pair's matches, that an essential matrix must hold: fewer may do so by chance
MAX_PX = 2.0
TRIALS = 500  # of five matches: enough where half of them are right
ENOUGH = 200  # matches to judge by
MIN_INLIER_SHARE = 0.5


class Verdict(NamedTuple):
    """What the matches with a geometry of their own say of the poses.

    Attributes:
        matches: how many they are.
        agreeing: share of them that agree with the poses; NaN without any.
    """

    matches: int
    inlier_share: float

    @property
    def confirmed(self) -> bool:
        """The photos agree with the poses."""
        return self.matches >= ENOUGH and self.inlier_share >= MIN_INLIER_SHARE

    @property
    def contradicted(self) -> bool:
        """They do not; neither this nor `confirmed` holds where they say too little."""
        return self.matches >= ENOUGH and self.inlier_share < MIN_INLIER_SHARE


def verdict(matches: Matches, cameras: Sequence[Camera], pairs: Iterable[tuple[int, int]]) -> Verdict:
    """Ask the pairs with most matches; the same input gives the same answer."""
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
    """(M,) pixels by which matches (M, 2) contradict two posed cameras: distance from the epipolar lines, or, of
    cameras in one place, from where the rotation takes them; infinite where it takes them out of sight."""
    if np.linalg.norm(first.centre - second.centre) > MIN_BASELINE_M:
        return epipolar_error(first, second, first_px, second_px)
    # any depth will do
    pixel, depth = second.project(second.centre + first.unproject(first_px, np.ones(len(first_px))) - first.centre)
    return np.where(depth > 0, np.linalg.norm(pixel - second_px, axis=1), np.inf)


def _own_geometry(first: Camera, second: Camera, first_px: np.ndarray, second_px: np.ndarray) -> np.ndarray:
    """(M,) bool: matches that one essential matrix holds, whatever the poses; none if it holds too few to mean much.

    A rotation is no special case: any direction of the shift serves it.
    """
    nothing = np.zeros(len(first_px), bool)
    if len(first_px) < OWN_MATCHES:
        return nothing
    options = pycolmap.RANSACOptions(min_num_trials=1, max_num_trials=TRIALS, max_error=MAX_PX, random_seed=0)
    own = essential_inliers(first, second, first_px, second_px, options)
    return own if own.sum() >= max(OWN_MATCHES, OWN_SHARE * len(own)) else nothing
