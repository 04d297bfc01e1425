"""Whether what is seen behind a plane is the room before it once more.

A place behind a mirror, reflected in its plane, lies on a surface of the room, has its colour, and is never where a
view sees free air. What is seen through a door or a window does neither. And a mirror has a wall or a frame around it,
where views see the plane itself: a plane through the middle of a symmetric room has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_closing, binary_dilation, binary_fill_holes, label
from scipy.spatial import KDTree

from room2dgs.mirrors.grid import BEHIND_M, WallGrid
from room2dgs.mirrors.settle import reflected
from room2dgs.mirrors.sights import Sights, SmallView

SQUARE = np.ones((3, 3))
NEAREST_M = 0.1  # of an image to a camera that is asked
ASKED = 12_000  # sights of a wall that are reflected
CONSISTENT, VIEWS = 2, 2  # of a depth that says where surface or free air is, and how many views must say so
SURFACE_M, SURFACE, FREE_M, FREE = 0.05, 0.03, 0.15, 0.08  # from a view's depth: on it, and before it
SAME_COLOR = 40.0, 16.0, 16.0  # L*a*b* of a place and its image: where a mirror is looked for
LEAST_CELLS, LEAST_SIGHTS, LEAST_VIEWS = 8, 60, 4
SAME_M = 0.06
MOST_FREE = 0.4  # images in free air, of those on surface
ALIKE = 0.6  # correlation of colours
RIM = 0.6  # of the cells around, where the plane itself is seen
SMALLER, LARGER = 3, 6  # cells that a side of a rectangle is moved from the cells that mirror
DEPTH_M = 1.5  # behind the glass, that something is seen: as deep as a room is before it


class Patch(NamedTuple):
    """A part of a wall that mirrors.

    Attributes:
        rectangle: (2, 2) int, its first cell and the one past its last.
        photos: views that show it.
        score: the larger, the surer.
    """

    rectangle: np.ndarray
    photos: int
    score: float


class _Asked(NamedTuple):
    """Those of a wall's B sights that are reflected: their places among them, their images, and which of them lie on
    surface, on surface of their colour, and in free air."""

    which: np.ndarray
    image: np.ndarray
    surface: np.ndarray
    same: np.ndarray
    air: np.ndarray


def gaps(grid: WallGrid, sights: Sights) -> bool:
    """Whether a part of the wall is seen through, and the wall around it is not: a mirror or an opening."""
    deep = grid.counted(sights.measured[grid.number] & (grid.past_m > DEPTH_M))
    parts, count = label((grid.crossed > 2) & (grid.crossed > grid.stopped), SQUARE)
    return any(
        (parts == one).sum() >= LEAST_CELLS
        and deep[parts == one].sum() >= LEAST_SIGHTS
        and _rim(grid, _closed(parts == one)) > RIM / 2
        for one in range(1, count + 1)
    )


def mirroring(grid: WallGrid, sights: Sights, views: Sequence[SmallView]) -> list[Patch]:
    """The parts of a wall that are mirrors."""
    asked = _reflect(grid, sights, views)
    same, air = grid.counted(asked.which[asked.same]), grid.counted(asked.which[asked.air])
    like = (same >= 2) & (same > 2 * air) & (grid.stopped < 2 * grid.crossed)
    parts, count = label(binary_closing(like, SQUARE), SQUARE)
    room: _Room | None = None
    found = []
    for one in range(1, count + 1):
        if (parts == one).sum() < LEAST_CELLS:
            continue
        frame = framed(grid, _closed(parts == one))
        within = frame.has(grid.cell[asked.which])
        surface, free = (within & asked.surface), (within & asked.air).sum()
        which = asked.which[surface]
        photos = len(np.unique(sights.view[grid.number[which]]))
        large = np.diff(frame.rectangle, axis=0).prod() >= LEAST_CELLS
        enough = large and len(which) >= LEAST_SIGHTS and photos >= LEAST_VIEWS
        if not enough or frame.rim < RIM or free > MOST_FREE * len(which):
            continue
        if np.percentile(grid.past_m[which], 95) < DEPTH_M:
            continue
        room = room or _Room(grid, sights)
        alike = room.alike(asked.image[surface], sights.color[grid.number[which]])
        if alike > ALIKE:
            found.append(Patch(frame.rectangle, photos, frame.rim * alike * len(which) / (len(which) + 2 * free)))
    return found


class _Room:
    """What is measured before a wall."""

    def __init__(self, grid: WallGrid, sights: Sights) -> None:
        before = sights.point @ grid.plane.normal - grid.plane.offset_m > BEHIND_M
        number = np.flatnonzero(sights.measured & before)[::2]
        self._tree, self._color = KDTree(sights.point[number]), sights.color[number]

    def alike(self, place: np.ndarray, color: np.ndarray) -> float:
        """Correlation of the colours (N, 3) of places (N, 3) with the room's there; 0 where it has too few there."""
        off, nearest = self._tree.query(place, distance_upper_bound=SAME_M)
        match = np.isfinite(off)
        if match.sum() < LEAST_SIGHTS:
            return 0.0
        one, other = (some - some.mean(axis=0) for some in (color[match], self._color[nearest[match]]))
        return float((one * other).sum() / max(np.sqrt((one**2).sum() * (other**2).sum()), 1e-12))


def _closed(cells: np.ndarray) -> np.ndarray:
    return binary_fill_holes(binary_closing(np.pad(cells, 3), SQUARE, 2)[3:-3, 3:-3])


def _rim(grid: WallGrid, cells: np.ndarray) -> float:
    """Of the cells around, the share where the plane is seen."""
    around = binary_dilation(cells, SQUARE, 2) & ~cells
    return (around & (grid.stopped > 2 * grid.crossed)).sum() / max(around.sum(), 1)


class Frame(NamedTuple):
    """A rectangle on a wall.

    Attributes:
        rectangle: (2, 2) int, its first cell and the one past its last.
        rim: of the cells around it, the share where the plane itself is seen.
    """

    rectangle: np.ndarray
    rim: float

    def has(self, cell: np.ndarray) -> np.ndarray:
        """Which of cells (N, 2) are in it."""
        first, past = self.rectangle
        return ((cell >= first) & (cell < past)).all(axis=1)


def framed(grid: WallGrid, cells: np.ndarray) -> Frame:
    """The rectangle near the cells (R, C) that is seen through inside and seen itself around, best of all."""
    place = np.argwhere(cells)
    low, high = place.min(axis=0), place.max(axis=0) + 1
    through, seen = grid.crossed > grid.stopped, grid.stopped > 2 * grid.crossed
    sums = [np.pad(kind.astype(np.int64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0))) for kind in (through, seen)]
    moves = np.stack(np.meshgrid(*[np.arange(-SMALLER, LARGER + 1)] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
    low, high = low - moves[:, :2], high + moves[:, 2:]
    fits = (low >= 1).all(axis=1) & (high < through.shape).all(axis=1) & (high - low >= 2).all(axis=1)
    low, high = low[fits], high[fits]
    inner, outer = ([_summed(one, low - wide, high + wide) for one in sums] for wide in (0, 1))
    area, around = (high - low).prod(axis=1), (high - low + 2).prod(axis=1) - (high - low).prod(axis=1)
    rim = [many - few for many, few in zip(outer, inner, strict=True)]
    best = int(np.argmax((inner[0] - inner[1]) / area + (rim[1] - rim[0]) / around))
    return Frame(np.stack([low[best], high[best]]), float(rim[1][best] / around[best]))


def _summed(sums: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Sums over rectangles, of a table of sums over all cells before each."""
    (a, b), (c, d) = low.T, high.T
    return sums[c, d] - sums[a, d] - sums[c, b] + sums[a, b]


def _reflect(grid: WallGrid, sights: Sights, views: Sequence[SmallView]) -> _Asked:
    which = np.flatnonzero(sights.measured[grid.number])
    if len(which) > ASKED:
        which = np.sort(np.random.default_rng(0).choice(which, ASKED, replace=False))
    far = sights.distance[grid.number[which]]  # what was measured from afar is off by more
    image, color = (reflected(sights.point[grid.number[which]], grid.plane), sights.color[grid.number[which]])
    surface, same, air = (np.zeros(len(which), np.int64) for _ in range(3))
    for view in views:
        place, column, row, z = view.camera.pixels_of(image, NEAREST_M)
        depth = view.depth[row, column]
        known = (depth > 0) & (view.num_consistent[row, column] >= CONSISTENT)
        on = known & (np.abs(depth - z) < np.maximum(SURFACE_M, SURFACE * np.maximum(z, far[place])))
        surface[place] += on
        same[place] += on & (np.abs(view.color[row, column] - color[place]) < SAME_COLOR).all(axis=1)
        air[place] += known & (depth - z > np.maximum(FREE_M, FREE * np.maximum(z, far[place])))
    free = (air >= VIEWS) & (air > 2 * same)
    return _Asked(which, image, (surface >= VIEWS) & (surface >= air), (same >= VIEWS) & (same >= air), free)
