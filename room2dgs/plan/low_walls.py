"""Walls that end far below the ceiling: two upright faces, back to back, that both stand on the floor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from room2dgs.lengths.length import Length
from room2dgs.plan.planes import LOWEST_WALL_M, Plane, UprightPlane
from room2dgs.plan.surface import LevelSurface

LEAST_M, LEAST_HIGH_M = 0.6, 0.5  # length and height
THICK_M = 0.05, 0.25  # of masonry and of boards; shelves are deeper
OPPOSITE = -0.995  # cosine between the faces' normals
COLUMN_M = 0.05  # along the wall
GAP = 3  # columns that things may hide
FOOT_M, TOP_M = 0.3, 0.15  # over the floor, and below the top: where a face is seen in a column that is the wall's
EDGE_SIGMA_M = 0.03  # of its ends and its top


@dataclass(frozen=True)
class LowWall:
    """A wall with a free top.

    Attributes:
        start, end: (2,) of its middle line, level frame, metres.
        high_m: of its top over the floor.
        thick_m: between its faces.
        faces: the two planes; the normal of the first one points to the left of the way from start to end.
        thickness: measured (`with_sigmas`); None: not measured.
    """

    start: np.ndarray
    end: np.ndarray
    high_m: float
    thick_m: float
    faces: tuple[Plane, Plane]
    thickness: Length | None = None

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(self.end - self.start))

    @property
    def corners(self) -> np.ndarray:
        """(4, 2) of its outline, counter-clockwise."""
        along = (self.end - self.start) / self.length_m
        aside = np.array([-along[1], along[0]]) * self.thick_m / 2
        return np.array([self.start - aside, self.end - aside, self.end + aside, self.start + aside])

    def as_dict(self, unit: str) -> dict[str, Any]:
        """Plain values."""
        measured = {} if self.thickness is None else {"thickness": self.thickness.as_dict(unit)}
        return {
            "corners": self.corners.tolist(),
            "length_m": self.length_m,
            "high_m": self.high_m,
            "thick_m": self.thick_m,
            "edge_sigma_m": EDGE_SIGMA_M,
            **measured,
        }


def low_walls(surface: LevelSurface, floor: Plane, planes: Sequence[UprightPlane]) -> tuple[LowWall, ...]:
    """Longest first.

    Args:
        planes: all upright ones, with their faces.
    """
    low = [one for one in planes if LEAST_HIGH_M <= one.plane.high_m - floor.offset_m < LOWEST_WALL_M]
    found = [wall for one, other in combinations(low, 2) for wall in _between(surface, floor, one, other)]
    return tuple(sorted(found, key=lambda wall: -wall.length_m))


def _between(surface: LevelSurface, floor: Plane, one: UprightPlane, other: UprightPlane) -> Iterator[LowWall]:
    thick = one.plane.offset_m + other.plane.offset_m
    back_to_back = one.plane.normal @ other.plane.normal < OPPOSITE and THICK_M[0] <= thick <= THICK_M[1]
    if not back_to_back:
        return
    normal = one.plane.normal[:2]
    along = np.array([normal[1], -normal[0]])  # the normal of the first face points to its left
    start = float((surface.middle[one.faces, :2] @ along).min())
    columns = [_whole_columns(surface, part, along, start, floor) for part in (one, other)]
    count = min(map(len, columns))
    first, last = _longest_run(columns[0][:count] & columns[1][:count])
    if (last - first) * COLUMN_M < LEAST_M:
        return
    middle = (one.plane.offset_m - thick / 2) * normal
    ends = [middle + (start + column * COLUMN_M) * along for column in (first, last)]
    yield LowWall(
        ends[0], ends[1], max(one.plane.high_m, other.plane.high_m) - floor.offset_m, thick, (one.plane, other.plane)
    )


def _whole_columns(
    surface: LevelSurface, part: UprightPlane, along: np.ndarray, start: float, floor: Plane
) -> np.ndarray:
    """(N,) bool: columns from `start` on in which a plane is seen near the floor and near its top."""
    place = surface.middle[part.faces]
    column = np.floor((place[:, :2] @ along - start) / COLUMN_M).astype(np.int64)
    place, column = place[column >= 0], column[column >= 0]
    count = int(column.max(initial=-1)) + 1
    low, top = place[:, 2] < floor.offset_m + FOOT_M, place[:, 2] > part.plane.high_m - TOP_M
    return (np.bincount(column[low], minlength=count) > 0) & (np.bincount(column[top], minlength=count) > 0)


def _longest_run(seen: np.ndarray) -> tuple[int, int]:
    """First column of the longest piece without gaps of more than `GAP`, and the one past its last."""
    number = np.flatnonzero(seen)
    if not len(number):
        return 0, 0
    pieces = np.split(number, np.flatnonzero(np.diff(number) > GAP + 1) + 1)
    longest = max(pieces, key=lambda piece: piece[-1] - piece[0])
    return int(longest[0]), int(longest[-1]) + 1
