"""What speaks for a view's completed depth and against it, as one array for the network that corrects it."""

from __future__ import annotations

import numpy as np

from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.stereo.geometric_consistency import GeometricConsistency

CONSISTENCY_VIEWS = 10  # views whose depth a view's is compared with
MOST = 0.5  # of ln of another source's depth over the completed
MOST_ERROR = 0.3  # relative
# The channels: PHOTO and NORMAL begin there and have three each (RGB; camera frame), RAYS two (x and y where z = 1).
# LN_DEPTH is over the view's median, LN_MEDIAN in metres. PRIOR, SAMPLE, OTHERS and PLANE are ln of the joint depth, of
# stereo, of what other views lend and of the room's planes over the completed depth.
PHOTO, LN_DEPTH, KNOWN, PRIOR, SAMPLE, SAMPLE_WEIGHT, NORMAL, NORMAL_WEIGHT, PRIOR_WEIGHT = 0, 3, 4, 5, 6, 7, 8, 11, 12
CONSISTENT, THROUGH, HIDDEN, FREE_SPACE, OTHERS, OTHERS_WEIGHT, PLANE, PLANE_WEIGHT, FLAT = range(13, 22)
ERROR, RAYS, LN_MEDIAN = 22, 23, 25
CHANNELS = 26
OF_NORMALS = (NORMAL, NORMAL + 1, NORMAL + 2, NORMAL_WEIGHT, PLANE, PLANE_WEIGHT, FLAT)  # 0 where nobody knows normals


def evidence(
    given: LowResInput,
    completed: Completed,
    others: GeometricConsistency,
    through: np.ndarray,
    lent: tuple[np.ndarray, np.ndarray],
    planes: tuple[np.ndarray, np.ndarray],
    error: np.ndarray,
) -> np.ndarray:
    """(CHANNELS, h, w) float32.

    Args:
        given: what the depth was completed from.
        completed: what came of it.
        others: what `CONSISTENCY_VIEWS` other views say of it.
        through: (h, w) share of all other views' word that there is nothing.
        lent: depth that other views have there and its weight (`depth_of_other_views`).
        planes: likewise of the room's planes (`on_planes`).
        error: (h, w) expected relative error.
    """
    known = completed.depth > 0
    median = float(np.median(completed.depth[known])) if known.any() else 1.0
    log_depth = np.log(np.where(known, completed.depth, median))

    def ratio(depth: np.ndarray) -> np.ndarray:
        both = known & (depth > 0)
        return np.clip(np.where(both, np.log(np.where(both, depth, 1)) - log_depth, 0), -MOST, MOST)

    found = np.empty((CHANNELS, *known.shape), np.float32)
    found[PHOTO : PHOTO + 3] = np.moveaxis(given.photo, 2, 0)
    found[LN_DEPTH] = log_depth - np.log(median)
    found[KNOWN] = known
    found[PRIOR] = ratio(given.prior)
    found[SAMPLE] = ratio(given.sample)
    found[SAMPLE_WEIGHT] = given.sample_weight * (given.sample > 0)
    found[NORMAL : NORMAL + 3] = np.moveaxis(given.camera.turned_to_camera(given.normal), 2, 0)
    found[NORMAL_WEIGHT] = given.slope_weight
    found[PRIOR_WEIGHT] = given.prior_weight
    counts = (others.num_consistent, others.num_seen_through, others.num_hidden)
    for channel, count in zip((CONSISTENT, THROUGH, HIDDEN), counts, strict=True):
        found[channel] = count / np.float32(CONSISTENCY_VIEWS)
    found[FREE_SPACE] = through
    for channel, (depth, weight) in ((OTHERS, lent), (PLANE, planes)):
        found[channel] = ratio(depth)
        found[channel + 1] = weight * (depth > 0)
    found[FLAT] = completed.flat
    found[ERROR] = np.minimum(error, MOST_ERROR)
    found[RAYS : RAYS + 2] = np.moveaxis(given.camera.rays()[..., :2], 2, 0)
    found[LN_MEDIAN] = np.log(median)
    return found
