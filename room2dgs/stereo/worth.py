"""How many agreeing views a depth of stereo is worth, by what else speaks for it or against it.

Views agree by chance, too: on blank walls beside things, which all of them take for as near as the thing. There, other
views look through the point or have something else before it, and the pixels around it lie on other surfaces. All of it
together tells wrong depth from right far better than the number of agreeing views (docs/studies/stereo.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.stereo.agreement import agreement
from room2dgs.stereo.planes import inverse_of

Seen = tuple[Camera, np.ndarray]  # a view and its (H, W) depth, metres, 0 = none
# Log odds that a depth is more than 5 cm off, by how many views agree alone: ALONE[0] - ALONE[1] * views
ALONE = (1.19, 0.505)
# and by the views that agree, look through it, and have something before it, and the shares of the pixels around it
# that lie on its surface, and that have a depth: fitted on filmed rooms (`tools/fit_worth.py`), alike on each
TOGETHER = (1.45, -0.18, 0.30, 0.15, -2.45, -1.07)
# Columns and rows to the pixels around, and to those opposite, in photos of WIDTH pixels
AROUND = ((3, 0), (6, 0), (0, 3), (0, 6), (3, 3), (3, -3), (6, 6), (6, -6))
WIDTH = 320
SAME_SURFACE = 0.01  # relative, of the mean inverse depth of opposite pixels


def worth(view: Seen, agreeing: np.ndarray, others: Sequence[Seen], max_px: float, max_relative: float) -> np.ndarray:
    """(H, W) uint8: views that would have to agree for a depth to be as likely right; 0: no depth, or rather wrong.

    Args:
        view: whose depth is in question.
        agreeing: (H, W) uint8, views that agree with it.
        others: its neighbours.
        max_px, max_relative: within which views agree (`agreement`).
    """
    found = evidence(view, agreeing, others, max_px, max_relative)
    odds = TOGETHER[0] + sum(weight * part for weight, part in zip(TOGETHER[1:], found, strict=True))
    views = (ALONE[0] - odds) / ALONE[1]
    return np.where(view[1] > 0, np.clip(np.rint(views), 0, 255), 0).astype(np.uint8)


def evidence(
    view: Seen, agreeing: np.ndarray, others: Sequence[Seen], max_px: float, max_relative: float
) -> tuple[np.ndarray, ...]:
    """What `TOGETHER` weighs, (H, W) each; args as of `worth`."""
    camera, depth = view
    inverse = inverse_of(depth)
    said = agreement(camera, inverse, [(other, inverse_of(theirs)) for other, theirs in others], max_px, max_relative)
    return agreeing, said.through, said.hidden, *_around(inverse)


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
