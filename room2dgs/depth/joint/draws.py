"""Random samples of one step of the joint depth optimisation, as many of each kind."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.depth.joint.overlap import Overlap

SLOPE_STEP = 4  # samples between the ends of a slope: less is rounding, more is another surface
# Rows of the draws, by the term whose samples they make.
POINTS = slice(0, 2)  # view, point
VIEWS = slice(2, 5)  # pair, row, column
SLOPES = slice(5, 9)  # view, row, column, 1 = the segment goes down, 0 = right
PLANES = slice(9, 14)  # view, row, column, steps down and right
AXES = slice(14, 19)  # likewise
ROWS = 19


def drawn(views: Overlap, count: int, generator: torch.Generator, axes: bool) -> Tensor:
    """(ROWS, count) int32; rows of what there is nothing of (points, pairs, the room's axes) are 0.

    A point is drawn by its view, so that all views have the same say: stereo finds thousands of points in a view of
    clutter and few in one of a blank wall, which needs them more.
    """
    height, width = views.depth.shape[1:]
    draws = torch.zeros(ROWS, count, dtype=torch.int32)

    def fill(row: int, low: int, high: int) -> None:
        torch.randint(low, high, (count,), generator=generator, out=draws[row])

    first, number = views.points_of_view
    seeing = number.nonzero()[:, 0]
    if len(seeing):
        view = seeing[torch.randint(len(seeing), (count,), generator=generator)]
        share = torch.rand(count, generator=generator, dtype=torch.float64)
        draws[POINTS] = torch.stack([view, first[view] + (share * number[view]).long()])
    if len(views.pairs):
        for row, high in zip(range(VIEWS.start, VIEWS.stop), (len(views.pairs), height, width), strict=True):
            fill(row, 0, high)
    if min(height, width) > SLOPE_STEP:
        highs = (len(views), height - SLOPE_STEP, width - SLOPE_STEP, 2)
        for row, high in zip(range(SLOPES.start, SLOPES.stop), highs, strict=True):
            fill(row, 0, high)
    reach = max(2, width // 4)
    for rows in (PLANES, AXES) if axes else (PLANES,):
        for row, high in zip(range(rows.start, rows.start + 3), (len(views), height, width), strict=True):
            fill(row, 0, high)
        fill(rows.start + 3, -reach, reach + 1)
        fill(rows.start + 4, -reach, reach + 1)
    return draws
