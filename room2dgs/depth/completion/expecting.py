"""How far off every view's completed depth is to be expected, by what the others say of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from room2dgs.depth.completion.evidence import CONSISTENCY_VIEWS
from room2dgs.depth.completion.expected_error import expected_relative_error
from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.small_maps import Completed
from room2dgs.stereo.geometric_consistency import GeometricConsistency, geometric_consistency
from room2dgs.stereo.planes import inverse_of

MAX_PX, MAX_RELATIVE = 2.0, 0.03
MOVED = 0.5  # of what other views moved a depth by, relatively, it is expected to be off


def expecting(
    small: Sequence[Completed], alone: Sequence[Completed], near: Sequence[Sequence[int]], space: FreeSpace | None
) -> Callable[[int], np.ndarray]:
    """What gives a view's (h, w) relative error: that of the depth that it finds alone, and more where others moved
    it.

    Args:
        small: of all views, what they have made of each other.
        alone: what each found by itself.
        near: for each, which others to ask, best first.
        space: depth that other views look through counts for less; None = not asked.
    """
    asked = asking(alone, near)

    def expected(view: int) -> np.ndarray:
        part = alone[view]
        through = seen_through(space, part.camera.unproject_map(part.depth))
        error = expected_relative_error(part.depth, part.anchor, part.trust, asked(view, part.depth), through)
        return error + MOVED * np.abs(small[view].log_scale - part.log_scale)

    return expected


def asking(
    alone: Sequence[Completed], near: Sequence[Sequence[int]]
) -> Callable[[int, np.ndarray], GeometricConsistency]:
    """What says how the others agree with a view's (h, w) depth; each counts by what it found by itself."""
    inverse = [inverse_of(part.depth) for part in alone]

    def asked(view: int, depth: np.ndarray) -> GeometricConsistency:
        beside = [(alone[other].camera, inverse[other]) for other in near[view][:CONSISTENCY_VIEWS]]
        return geometric_consistency(alone[view].camera, inverse_of(depth), beside, MAX_PX, MAX_RELATIVE)

    return asked
