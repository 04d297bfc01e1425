"""Tears: boundary of a mesh where the surface that the views saw goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from room2dgs.eval.boundary import Boundary
from room2dgs.eval.sightlines import Sightlines, tally

BEYOND_M = 0.04  # so far beyond an edge is asked whether the surface goes on
# upper ends of a hole's size, metres: the diameter of the circle with its perimeter
HOLE_SIZES = {"under_3cm": 0.03, "3_to_10cm": 0.10, "10_to_30cm": 0.30, "over_30cm": np.inf}


@dataclass(frozen=True)
class Tears:
    """The judged boundary.

    Attributes:
        boundary: all of it.
        torn: (E,) bool: the surface goes on there, or nothing says that it does not.
        edge: (E,) bool: views see free space there: a real edge. The rest is where too few views look.
        holes: size class -> number of loops around a hole, at least half of whose length is torn.
    """

    boundary: Boundary
    torn: np.ndarray
    edge: np.ndarray
    holes: dict[str, int]

    @property
    def torn_m(self) -> float:
        """Length of the tears, metres; the two sides of a slit count each."""
        return float(self.boundary.length[self.torn].sum())


def tears(boundary: Boundary, views: Sequence[Sightlines]) -> Tears:
    """Judge each part of the boundary by a point a little beyond it.

    It is torn if at least `SEEN` views look at that point and no majority of those that know the depth sees through it.
    """
    said = tally(boundary.middle + BEYOND_M * boundary.outward, views)
    torn, edge = said.seen & ~said.empty, said.seen & said.empty
    return Tears(boundary, torn, edge, _holes(boundary, torn))


def _holes(boundary: Boundary, torn: np.ndarray) -> dict[str, int]:
    length, loops = boundary.length, int(boundary.loop.max(initial=-1)) + 1
    around = np.bincount(boundary.loop, length, loops)
    moments = np.stack([np.bincount(boundary.loop, length * x, loops) for x in boundary.middle.T], axis=1)
    middle = moments / np.maximum(around, 1e-12)[:, None]
    # Of a hole's rim outward is inward: the outer rim of a piece is no hole.
    to_middle = np.einsum("nc,nc->n", boundary.outward, middle[boundary.loop] - boundary.middle)
    inward = np.bincount(boundary.loop, length * to_middle, loops) > 0
    size = around[inward & (np.bincount(boundary.loop, length * torn, loops) >= around / 2)] / np.pi
    bins = np.searchsorted(list(HOLE_SIZES.values()), size, side="right")
    counts = np.bincount(bins, minlength=len(HOLE_SIZES))
    return {name: int(count) for name, count in zip(HOLE_SIZES, counts, strict=True)}
