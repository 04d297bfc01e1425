"""The relative standard deviation to be expected of every view's completed depth, by what the others say of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from room2dgs.depth.completion.evidence import CONSISTENCY_VIEWS
from room2dgs.depth.completion.expected_error import expected_relative_error
from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.low_res import Completed
from room2dgs.stereo.geometric_consistency import GeometricConsistency, geometric_consistency
from room2dgs.stereo.planes import inverse_of

MAX_PX, MAX_RELATIVE = 2.0, 0.03
DRAWN = 0.5  # of what other views have drawn a depth by, relatively, it is expected to be off


def expecting(
    together: Sequence[Completed],
    alone: Sequence[Completed],
    near: Sequence[np.ndarray | Sequence[int]],
    space: FreeSpace | None,
) -> Callable[[int], np.ndarray]:
    """A function that gives a view's (h, w) sigma: of the depth that it finds alone, and more where others moved it.

    Args:
        together: of all views, what they have made of each other.
        alone: what each found by itself.
        near: for each, the views to compare it with, best first.
        space: depth that other views look through is expected to be off by more; None = not known.
    """
    compared = comparing(alone, near)

    def expected(view: int) -> np.ndarray:
        part = alone[view]
        through = seen_through(space, part.camera.unproject_map(part.depth))
        consistency = compared(view, part.depth)
        error = expected_relative_error(part.depth, part.sample, part.sample_weight, consistency, through)
        return error + DRAWN * np.abs(together[view].log_scale - part.log_scale)

    return expected


def comparing(
    alone: Sequence[Completed], near: Sequence[np.ndarray | Sequence[int]]
) -> Callable[[int, np.ndarray], GeometricConsistency]:
    """A function that compares a view's (h, w) depth with the others'; each counts by what it found by itself."""
    inverse = [inverse_of(part.depth) for part in alone]

    def compared(view: int, depth: np.ndarray) -> GeometricConsistency:
        others = [(alone[other].camera, inverse[other]) for other in near[view][:CONSISTENCY_VIEWS]]
        return geometric_consistency(alone[view].camera, inverse_of(depth), others, MAX_PX, MAX_RELATIVE)

    return compared
