"""What openings may be, and by which signs each is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from room2dgs.plan.rectangles import Rectangles, signs
from room2dgs.plan.wall_map import Evidence, WallMap

TALL_M = 1.7  # as high as doors and French windows reach at least
FRAME_M = 0.075  # how far within the rim of what is framed the evidence may begin
MOST_UNUSUAL = 4.0  # that a size speaks against an opening: half the square of its deviations


@dataclass(frozen=True)
class Usual:
    """A size that is usual, and its deviation; metres."""

    mean: float
    sigma: float

    def unusual(self, value: np.ndarray) -> np.ndarray:
        return np.minimum(((value - self.mean) / self.sigma) ** 2 / 2, MOST_UNUSUAL)


@dataclass(frozen=True)
class Weights:
    """Of the signs of a rectangle in the logarithm of the odds that it is an opening of a kind.

    Attributes:
        base: without any sign.
        size: of what is unusual in its size, which speaks against it.
        area: of the logarithm of its square metres.
        The others: as `Signs` has them.
    """

    base: float
    inside: float
    edge: float
    worst: float
    step: float = 0.0
    frame: float = 0.0
    tint: float = 0.0
    known: float = 0.0
    size: float = 0.0
    area: float = 0.0


@dataclass(frozen=True)
class Kind:
    """A kind of opening.

    Attributes:
        evidence: what speaks for it in each cell of a wall.
        through: views look through it.
        on_floor: it stands on the floor.
        framed: its evidence is within a frame that belongs to it; it may reach the floor where it is tall.
        least_m: width and height at least.
        lowest_m: where it begins at least.
        width, top: usual ones; None: any.
    """

    name: str
    evidence: Callable[[WallMap], Evidence]
    weights: Weights
    least_m: tuple[float, float]
    closed: bool = False
    through: bool = False
    on_floor: bool = False
    framed: bool = False
    lowest_m: float = 0.0
    width: Usual | None = None
    top: Usual | None = None

    def scores(self, wall: WallMap, of: Rectangles) -> np.ndarray:
        """(R,) logarithm of the odds of each rectangle; -inf: it begins too low."""
        found, weight = signs(wall, self.evidence(wall), of, FRAME_M if self.framed else 0.0), self.weights
        unusual = np.zeros(len(of))
        for usual, value in ((self.width, of.width_m), (self.top, of.low_m + of.height_m)):
            unusual += 0.0 if usual is None else usual.unusual(value)
        score = weight.base - weight.size * unusual + weight.area * np.log(of.width_m * of.height_m)
        tall = of.low_m + of.height_m >= TALL_M
        for name in ("inside", "step", "edge", "worst", "frame", "tint", "known"):
            score = score + getattr(weight, name) * getattr(found, name)
        return np.where((of.low_m >= self.lowest_m) | (tall & self.framed), score, -np.inf)


# Weights: logistic regression on the walls of made rooms, the right rectangle against the best wrong ones; a base is
# half way between the worst right one and the best wrong one. Niches, too few of which were there, have those of doors.
DOOR = Kind(
    "door",
    lambda wall: wall.hole,
    Weights(-12.3, inside=2.6, step=7.3, edge=2.1, worst=5.1, frame=4.2, size=0.2),
    least_m=(0.5, TALL_M),
    through=True,
    on_floor=True,
    width=Usual(0.9, 0.25),
    top=Usual(2.08, 0.15),
)
CLOSED_DOOR = Kind(
    "door",
    lambda wall: wall.leaf,
    Weights(-12.7, inside=3.4, edge=3.2, worst=5.2, frame=3.6, tint=2.2, known=4.0, size=0.7),
    least_m=(0.55, TALL_M),
    closed=True,
    on_floor=True,
    width=Usual(0.85, 0.12),
    top=Usual(2.03, 0.09),
)
WINDOW = Kind(
    "window",
    lambda wall: wall.pane,
    Weights(-13.2, inside=4.6, step=2.7, edge=3.9, worst=6.1, area=1.0),
    least_m=(0.35, 0.35),
    framed=True,
    lowest_m=0.25,  # radiators shine too
)
NICHE = Kind(
    "niche",
    lambda wall: wall.hole,
    Weights(-12.3, inside=2.6, step=7.3, edge=2.1, worst=5.1),
    least_m=(0.25, 0.25),
    through=True,
    lowest_m=0.25,  # what is lower stands on the floor
)
KINDS = (DOOR, CLOSED_DOOR, WINDOW, NICHE)
