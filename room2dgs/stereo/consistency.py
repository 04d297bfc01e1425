"""Calibrated consistency: how many consistent views a depth of stereo counts as, by all that speaks for or against it.

Views are consistent by chance, too: on blank walls beside things, which all of them take for as near as the thing.
There, other views look through the point or see something nearer before it, and the pixels around it lie on other
surfaces. All of this together tells wrong depth from right far better than the number of consistent views alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.stereo.geometric_consistency import geometric_consistency
from room2dgs.stereo.planes import inverse_of

DepthView = tuple[Camera, np.ndarray]  # a view and its (H, W) depth, metres, 0 = none
# Log odds that a depth is more than 5 cm off: by the number n of consistent views alone, COUNT_ALONE[0] -
# COUNT_ALONE[1] n
COUNT_ALONE = (1.19, 0.505)
# and by the views that are consistent, look through it, and see something before it, and the shares of the pixels
# around it that lie on its surface, and that have a depth: fitted on filmed rooms (`tools/fit_consistency.py`)
ALL_EVIDENCE = (1.45, -0.18, 0.30, 0.15, -2.45, -1.07)
# Columns and rows to the pixels around, and to those opposite, in photos of WIDTH pixels
AROUND = ((3, 0), (6, 0), (0, 3), (0, 6), (3, 3), (3, -3), (6, 6), (6, -6))
WIDTH = 320
SAME_SURFACE = 0.01  # relative, of the mean inverse depth of opposite pixels


def calibrated_consistency(
    view: DepthView, num_consistent: np.ndarray, others: Sequence[DepthView], max_px: float, max_relative: float
) -> np.ndarray:
    """(H, W) uint8: so many consistent views alone would make a depth as probable; 0: no depth, or probably wrong.

    Args:
        view: whose depth is in question.
        num_consistent: (H, W) uint8, views that are consistent with it.
        others: its neighbours.
        max_px, max_relative: within which views are consistent (`geometric_consistency`).
    """
    evidence = consistency_evidence(view, num_consistent, others, max_px, max_relative)
    odds = ALL_EVIDENCE[0] + sum(weight * part for weight, part in zip(ALL_EVIDENCE[1:], evidence, strict=True))
    views = (COUNT_ALONE[0] - odds) / COUNT_ALONE[1]
    return np.where(view[1] > 0, np.clip(np.rint(views), 0, 255), 0).astype(np.uint8)


def consistency_evidence(
    view: DepthView, num_consistent: np.ndarray, others: Sequence[DepthView], max_px: float, max_relative: float
) -> tuple[np.ndarray, ...]:
    """What `ALL_EVIDENCE` weighs, (H, W) each; arguments as of `calibrated_consistency`."""
    camera, depth = view
    inverse = inverse_of(depth)
    neighbours = [(other, inverse_of(theirs)) for other, theirs in others]
    found = geometric_consistency(camera, inverse, neighbours, max_px, max_relative)
    return num_consistent, found.num_seen_through, found.num_hidden, *_around(inverse)


def _around(inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) shares of the pixels around: of opposite ones, whose mean lies on a pixel's surface; that have a depth."""
    height, width = inverse.shape
    step = max(1, round(width / WIDTH))
    reach = step * max(max(abs(x), abs(y)) for x, y in AROUND)
    wide = np.pad(inverse, reach, constant_values=-1)  # less than nothing: beyond the photo
    pairs, same, inside, known = (np.zeros(inverse.shape, np.float32) for _ in range(4))
    for x, y in AROUND:
        one, opposite = (
            wide[reach + s * y : reach + s * y + height, reach + s * x : reach + s * x + width] for s in (step, -step)
        )
        both = (one > 0) & (opposite > 0)
        pairs += both
        same += both & (np.abs(one + opposite - 2 * inverse) < 2 * SAME_SURFACE * inverse)
        for beside in (one, opposite):
            inside += beside >= 0
            known += beside > 0
    return same / np.maximum(pairs, 1), known / np.maximum(inside, 1)
