"""A wall in small cells: what rays say of each, what photos show of it, and where edges run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from room2dgs.plan.crossings import Crossings, crossings
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.outline import Side
from room2dgs.plan.sight import Rays
from room2dgs.plan.wall_picture import Look

CELL_M = 0.025
USUAL_TOP_M = 2.6  # of a wall whose ceiling is not known
EDGE_NOISE, EDGE_LEAST = 2.0, 0.03  # contrast of an edge that counts half: medians of the wall's, and grey levels
DARK, SHINING, LEAST_SPAN = 0.5, 0.97, 0.1  # grey levels: of a wall at least, of a window's pane, and between them


@dataclass(frozen=True)
class Evidence:
    """What speaks for something in each cell: (X, Z) how much, of how much that was seen."""

    found: np.ndarray
    of: np.ndarray


@dataclass(frozen=True)
class Lines:
    """Edges along one way of the wall, on the lines between its cells: (L, M), one more line than cells.

    Attributes:
        strength: 0..1, of the contrast over each line.
        known: whether photos show both sides of it.
    """

    strength: np.ndarray
    known: np.ndarray


@dataclass(frozen=True)
class WallMap:
    """X cells along a side and Z up from the floor.

    Attributes:
        crossings: the rays.
        color: (X, Z, 3) 0..1.
        known: (X, Z) bool: a photo shows it.
    """

    crossings: Crossings
    color: np.ndarray
    known: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        return self.known.shape[0], self.known.shape[1]

    def count(self, which: np.ndarray) -> np.ndarray:
        """(X, Z) rays, of those that are asked for."""
        edges = [np.arange(cells + 1) * CELL_M for cells in self.shape]
        return np.histogram2d(self.crossings.along[which], self.crossings.up[which], bins=edges)[0]

    @cached_property
    def hole(self) -> Evidence:
        """That there is a hole, of any depth."""
        return Evidence(self.count(self.crossings.through), self._ended)

    @cached_property
    def leaf(self) -> Evidence:
        """That something is fixed on the wall that is as thick as a door."""
        return Evidence(self.count(self.crossings.before), self._ended)

    @cached_property
    def _ended(self) -> np.ndarray:
        """(X, Z) rays that end behind the wall, on it, or a door's thickness before it."""
        return self.count(self.crossings.through | self.crossings.on | self.crossings.before)

    @cached_property
    def grey(self) -> float:
        """Grey level of the wall itself."""
        flat = self.known & (self.count(self.crossings.on) > 0)
        return float(np.median(self.color[flat].mean(axis=1))) if flat.any() else DARK

    @cached_property
    def pane(self) -> Evidence:
        """That it shines as a window does, against the wall."""
        base = float(np.clip(self.grey, DARK, SHINING - LEAST_SPAN))
        shines = np.clip((self.color.mean(axis=2) - base) / (SHINING - base), 0, 1)
        return Evidence(self.known * shines, self.known.astype(np.float64))

    @cached_property
    def lines(self) -> tuple[Lines, Lines]:
        """Upright ones, by their place along the wall, and level ones, by their height."""
        return _lines(self.color, self.known), _lines(self.color.transpose(1, 0, 2), self.known.T)


def wall_map(plan: FloorPlan, side: Side, rays: Rays, look: Look) -> WallMap:
    """Of the wall of a side, up to the ceiling.

    Args:
        rays: in the plan's level frame.
    """
    top_m = plan.height_m or USUAL_TOP_M
    wall = plan.walls[side.wall or 0]
    along = np.append((side.end - side.start) / side.length_m, 0.0)
    start = np.append(side.start, plan.floor.offset_m)
    start = start - wall.normal * (start @ wall.normal - wall.offset_m)
    x, z = ((np.arange(int(np.ceil(size / CELL_M))) + 0.5) * CELL_M for size in (side.length_m, top_m))
    places = start + x[:, None, None] * along + z[None, :, None] * np.array([0.0, 0, 1])
    seen = look(places.reshape(-1, 3), wall.normal)
    shape = len(x), len(z)
    return WallMap(crossings(plan, side, rays, top_m), seen.color.reshape(*shape, 3), seen.known.reshape(shape))


def _lines(color: np.ndarray, known: np.ndarray) -> Lines:
    """Contrast between the two cells before each line and the two after it, against what is usual on the wall."""
    cells = len(known)
    four = np.pad(color, ((2, 2), (0, 0), (0, 0)), mode="edge")
    seen = np.pad(known, ((2, 2), (0, 0)))
    part = [slice(shift, shift + cells + 1) for shift in range(4)]
    both = seen[part[0]] & seen[part[1]] & seen[part[2]] & seen[part[3]]
    contrast = np.linalg.norm((four[part[2]] + four[part[3]] - four[part[0]] - four[part[1]]) / 2, axis=2) * both
    usual = float(np.median(contrast[both])) if both.any() else 0.0
    strength = contrast / (contrast + EDGE_NOISE * usual + EDGE_LEAST)
    return Lines(strength, both)
