"""Where a walker can hold the camera: a raster of the places at hand height that are clear of everything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from room2dgs.tools.random_rooms.layout import RandomRoom

CELL = 0.08  # metres
COMFORT = 0.6  # metres of clearance beyond which a detour no longer pays
Distance = Callable[[np.ndarray], np.ndarray]
DIAGONAL = np.sqrt(2.0)
STEPS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, DIAGONAL), (1, -1, DIAGONAL))


@dataclass(frozen=True)
class FreeAir:
    """The largest connected piece of free places.

    Attributes:
        places: (N, 2) x and y, metres.
        clearance: (N,) metres to the nearest surface, the least over the heights.
        links: (N, N) sparse lengths between neighbours, longer where it is narrow.
    """

    places: np.ndarray
    clearance: np.ndarray
    links: coo_array

    @property
    def area(self) -> float:
        """Square metres."""
        return len(self.places) * CELL**2

    def nearest(self, point: np.ndarray) -> int:
        """The place nearest to a point (2,)."""
        return int(np.linalg.norm(self.places - point, axis=1).argmin())

    def route(self, start: int, end: int) -> np.ndarray:
        """(K,) places from start to end along the links."""
        before = dijkstra(self.links, directed=False, indices=end, return_predecessors=True)[1]
        route = [start]
        while route[-1] != end:
            route.append(int(before[route[-1]]))
        return np.array(route)


def free_air(room: RandomRoom, distance: Distance, heights: np.ndarray, clearance: float) -> FreeAir | None:
    """Places whose clearance holds at all heights (metres); None if there are none."""
    (low_x, low_y, _), (high_x, high_y, _) = room.bounds
    x, y = np.meshgrid(np.arange(low_x, high_x, CELL) + CELL / 2, np.arange(low_y, high_y, CELL) + CELL / 2)
    spots = np.column_stack([x.ravel(), y.ravel()])
    least = np.full(len(spots), np.inf)
    for height in heights:
        points = np.column_stack([spots, np.full(len(spots), height)])
        usable = room.inside(points) & ~room.blocked(points)
        least = np.minimum(least, np.where(usable, distance(points), 0.0))
    free = (least >= clearance).reshape(x.shape)
    pieces, count = label(free)
    if not count:
        return None
    biggest = pieces == 1 + np.argmax([np.count_nonzero(pieces == 1 + piece) for piece in range(count)])
    least = least.reshape(x.shape)
    return FreeAir(spots[biggest.ravel()], least[biggest], _links(biggest, least))


def _links(free: np.ndarray, clearance: np.ndarray) -> coo_array:
    """Neighbouring free cells; a metre where it is narrow counts for up to three."""
    number = np.cumsum(free.ravel()).reshape(free.shape) - 1
    cost = 1 + 2 * np.clip(1 - clearance / COMFORT, 0, 1)
    rows, columns, lengths = [], [], []
    for down, right, length in STEPS:
        here = (slice(0, free.shape[0] - down), slice(max(0, -right), free.shape[1] - max(0, right)))
        there = (slice(down, None), slice(max(0, right), free.shape[1] + min(0, right)))
        both = free[here] & free[there]
        rows.append(number[here][both])
        columns.append(number[there][both])
        lengths.append(CELL * length * (cost[here][both] + cost[there][both]) / 2)
    count = int(free.sum())
    return coo_array((np.concatenate(lengths), (np.concatenate(rows), np.concatenate(columns))), (count, count))
