"""What lies beyond each part of a mesh's open boundary, by what the run itself has seen: holes are told from edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from room2dgs.eval.boundary import Boundary
from room2dgs.eval.sightlines import Sightlines, tally

BEYOND_M = 0.12  # so far beyond an edge is asked what is there: nearer, what is in front blurs into it
FREE, NOT_SEEN, NOT_TRUSTED = 0, 1, 2
NAMES = ("free", "not_seen", "not_trusted")
WORDS = ("seen to be free", "not seen", "seen, not trusted")
COLORS = np.array([[38, 102, 230], [128, 128, 128], [230, 26, 26]], np.uint8)  # blue, grey, red


@dataclass(frozen=True)
class JudgedBoundary:
    """A boundary and its kinds.

    Attributes:
        boundary: E parts.
        kind: (E,) uint8, `FREE`, `NOT_SEEN` or `NOT_TRUSTED`.
    """

    boundary: Boundary
    kind: np.ndarray

    @property
    def metres(self) -> dict[str, float]:
        """Length by kind."""
        total = np.bincount(self.kind, self.boundary.length, len(NAMES))
        return dict(zip(NAMES, map(float, total), strict=True))


def judged(boundary: Boundary, views: Sequence[Sightlines]) -> JudgedBoundary:
    """Each part by a point a little beyond it, in the plane of its face.

    It is free where more views see through that point than see surface there, and not seen where fewer than `SEEN`
    views look at it, the point being hidden from the others or outside their pictures; else views look there, and no
    depth is sure enough to say what is there.

    Args:
        views: with the depth that the run trusts alone.
    """
    said = tally(boundary.middle + BEYOND_M * boundary.outward, views)
    kind = np.where(said.empty, FREE, np.where(said.seen, NOT_TRUSTED, NOT_SEEN))
    return JudgedBoundary(boundary, kind.astype(np.uint8))
