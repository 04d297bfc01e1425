"""Finding room for pieces: a raster of the floor and the free stretches of the walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from room2dgs.demo_room.geometry import Patch
from room2dgs.tools.random_rooms.shapes import extent, moved, rotation
from room2dgs.tools.random_rooms.shell import Space

if TYPE_CHECKING:
    from room2dgs.tools.random_rooms.draft import Draft

CELL = 0.05  # metres of the floor's raster
Rng = np.random.Generator


class Wall:
    """What hangs on or stands before one wall: rectangles along it."""

    def __init__(self, space: Space, index: int):
        self.space, self.index = space, index
        self.length = space.wall(index)[1]
        self.taken: list[tuple[float, float, float, float]] = []

    def height(self, along: float, width: float) -> float:
        """Ceiling over a stretch, metres."""
        return self.space.wall_height(self.index, along - width / 2, along + width / 2)

    def free_spot(self, rng: Rng, width: float, low: float, high: float) -> float | None:
        """Metres along the wall to the middle of a free rectangle of `width` from low to high, or None."""
        if width > self.length:
            return None
        for _ in range(8):
            along = float(rng.uniform(width / 2, self.length - width / 2))
            left, right = along - width / 2, along + width / 2
            clash = any(left < r and l < right and low < t and b < high for l, r, b, t in self.taken)
            if not clash and high <= self.height(along, width) + 1e-6:
                return along
        return None

    def take(self, along: float, width: float, low: float, high: float) -> None:
        """Marks a rectangle as used."""
        self.taken.append((along - width / 2, along + width / 2, low, high))


class Plan:
    """The floor's free cells, and the boxes around what stands on it."""

    def __init__(self, space: Space):
        self.space = space
        self.low = space.outline.min(axis=0)
        columns, rows = np.ceil((space.outline.max(axis=0) - self.low) / CELL).astype(int) + 1
        x, y = np.meshgrid(
            self.low[0] + (np.arange(columns) + 0.5) * CELL, self.low[1] + (np.arange(rows) + 0.5) * CELL
        )
        self.inner = space.contains(np.column_stack([x.ravel(), y.ravel()])).reshape(rows, columns)
        self.free = self.inner.copy()
        self.area = float(self.inner.sum()) * CELL**2
        self.boxes: list[tuple[np.ndarray, float, np.ndarray, np.ndarray]] = []

    def cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of points (N, 2), clipped to the raster."""
        index = np.floor((points - self.low) / CELL).astype(int)
        return (
            np.clip(index[:, 1], 0, self.free.shape[0] - 1),
            np.clip(index[:, 0], 0, self.free.shape[1] - 1),
        )

    def footprint(self, low, high, origin, yaw: float, shrink: float = 0.03) -> np.ndarray:
        """(N, 2) points over a turned rectangle, at most a cell apart."""
        low, high = np.asarray(low[:2]) + shrink, np.asarray(high[:2]) - shrink
        high = np.maximum(high, low + 1e-3)
        count = np.maximum(np.ceil((high - low) / (0.9 * CELL)).astype(int), 1) + 1
        x, y = np.meshgrid(np.linspace(low[0], high[0], count[0]), np.linspace(low[1], high[1], count[1]))
        return np.column_stack([x.ravel(), y.ravel()]) @ rotation(yaw)[:2, :2].T + np.asarray(origin[:2])

    def try_at(self, patches: list[Patch], origin, yaw: float, flat: bool = False) -> list[Patch] | None:
        """The piece turned and moved to (x, y) if its footprint is free and it fits below the ceiling."""
        low, high = extent(patches)
        points = self.footprint(low, high, origin, yaw)
        if ((points < self.low) | (points > self.low + np.array(self.free.shape[::-1]) * CELL)).any():
            return None
        rows, columns = self.cells(points)
        if not (self.inner if flat else self.free)[rows, columns].all():
            return None
        if high[2] > self.space.top(points[:, 1]).min():
            return None
        if not flat:
            self.free[rows, columns] = False
            if (high - low).min() > 0.15 and high[2] > 0.3:
                self.boxes.append((np.array([*origin[:2], 0.0]), yaw, low, high))
        return moved(patches, (*origin[:2], 0.0), yaw)

    def keep_free(self, space: Space, wall: int, along: float, width: float, depth: float) -> None:
        """Takes the floor before a passage, so that nothing is put there."""
        start, _, yaw = space.wall(wall)
        origin = start + along * np.array([np.cos(yaw), np.sin(yaw)])
        points = self.footprint((-width / 2, 0.0), (width / 2, depth), origin, yaw)
        self.free[self.cells(points)] = False

    def keep_box(self, patches: list[Patch], origin, yaw: float) -> None:
        """Remembers a piece that does not stand on the floor, so that no camera gets into it."""
        low, high = extent(patches)
        if (high - low).min() > 0.1:
            self.boxes.append((np.asarray(origin, float), yaw, low, high))

    def place(self, rng: Rng, draft: Draft, patches: list[Patch], flat: bool = False, tries: int = 8) -> bool:
        """Puts a free-standing piece somewhere on the floor; False if there was no room."""
        rows, columns = np.nonzero(self.inner if flat else self.free)
        for _ in range(tries if len(rows) else 0):
            k = rng.integers(len(rows))
            spot = self.low + (np.array([columns[k], rows[k]]) + 0.5) * CELL
            yaw = rng.choice([0, 1, 2, 3]) * np.pi / 2 + rng.normal(0, draft.style.turn)
            yaw = rng.uniform(-np.pi, np.pi) if rng.random() < 0.2 else yaw
            found = self.try_at(patches, spot, yaw, flat)
            if found is not None:
                draft.patches += found
                return True
        return False

    def place_at_wall(self, rng: Rng, draft: Draft, patches: list[Patch], tries: int = 8) -> bool:
        """Stands a piece at a wall (its y = 0); False if there was no room."""
        low, high = extent(patches)
        for _ in range(tries):
            wall = draft.walls[rng.integers(len(draft.walls))]
            start, length, yaw = self.space.wall(wall.index)
            width = 2 * float(np.abs([low[0], high[0]]).max())
            along = wall.free_spot(rng, width, 0.02, float(high[2]))
            if along is None:
                continue
            if rng.random() < 0.25:  # into a corner
                side = width / 2 + 0.02 if rng.random() < 0.5 else length - width / 2 - 0.02
                clash = any(side - width / 2 < r and l < side + width / 2 and b < high[2] for l, r, b, _ in wall.taken)
                along = along if clash else side
            off = rng.uniform(0, 0.03) if rng.random() < 0.8 else rng.uniform(0.03, 0.4)
            turn = rng.normal(0, 0.3 * draft.style.turn)
            along_wall = np.array([np.cos(yaw), np.sin(yaw)])
            inwards = np.array([-along_wall[1], along_wall[0]])
            spot = start + along * along_wall + (off + abs(np.sin(turn)) * width / 2) * inwards
            found = self.try_at(patches, spot, yaw + turn)
            if found is not None:
                wall.take(along, width, 0.0, float(high[2]) + 0.03)
                draft.patches += found
                return True
        return False

    def blocked(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool: points (N, 3) within 5 cm of the bounding box of a piece."""
        hit = np.zeros(len(points), bool)
        for origin, yaw, low, high in self.boxes:
            local = (points - origin) @ rotation(yaw)
            hit |= ((local > low - 0.05) & (local < high + 0.05)).all(axis=1)
        return hit
