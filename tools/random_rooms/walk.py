"""A hand-held walk through a random room: one path through free air, the gaze sweeping across the room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.sparse.csgraph import dijkstra

from room2dgs.demo_room.path import pose
from room2dgs.tools.random_rooms.free_air import CELL, FreeAir, free_air
from room2dgs.tools.random_rooms.layout import RandomRoom

CLEARANCE = 0.3  # metres between the camera and any surface
MARGIN = 0.05  # metres of clearance that smoothing and the hand may use up
LOW, HIGH = 1.3, 1.6  # metres, of the camera
PHOTOS = (60, 120)
STEP = (0.08, 0.20)  # metres between neighbouring photos
PACE = (0.10, 0.165)  # metres, of the mean step
FOV = (58.0, 75.0)  # degrees, horizontal
FASTEST_TURN = np.radians(13.0)  # a photo
SMALLEST = 1.2  # square metres of free air
WAYPOINTS = 9
GAZES, ROUTES = 24, 6  # tries
GRID = (15, 11)  # rays of a trial picture
TOO_NEAR = 0.6  # metres, of the median of a picture
CELLS = 0.3  # metres, edge of the cells whose views are counted
SEEN_ENOUGH = 5  # views of a cell
Distance = Callable[[np.ndarray], np.ndarray]
Reach = Callable[[np.ndarray, np.ndarray], np.ndarray]
Rng = np.random.Generator


@dataclass(frozen=True)
class Walk:
    """A filmed walk.

    Attributes:
        fov: horizontal, degrees.
        poses: (F, 4, 4) world_from_cam, metres, OpenCV axes.
    """

    fov: float
    poses: np.ndarray


def random_walk(room: RandomRoom, distance: Distance, reach: Reach, rng: Rng, photos: int | None = None) -> Walk | None:
    """Draws a walk that sees as much as it can from several places.

    Args:
        room: where to walk.
        distance: points (N, 3) -> (N,) metres to the nearest surface.
        reach: origins and unit directions (N, 3) -> (N,) metres to the first surface.
        rng: draws the route, the hand and the gaze.
        photos: how many; None lets the room's size say.

    Returns:
        None if the room has no air to walk in, or all that can be filmed is close before the lens.
    """
    air = free_air(room, distance, np.linspace(LOW - 0.02, HIGH + 0.02, 5), CLEARANCE + MARGIN)
    if air is None or air.area < SMALLEST:
        return None
    count = photos or int(np.clip(round(48 + 2.4 * floor_area(room)), *PHOTOS))
    for _ in range(ROUTES):
        ground = steady(tour(air, rng, PACE[0] * (count - 1)), count, rng)
        centres = held(ground, rng)
        steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
        if distance(centres).min() >= CLEARANCE and steps.max(initial=STEP[0]) <= STEP[1] and steps.min() >= STEP[0]:
            break
    else:
        return None
    fov = float(rng.uniform(*FOV))
    tries = [gaze(air, centres, rng) for _ in range(GAZES)]
    films = [np.stack([pose(at, *angles) for at, angles in zip(centres, look, strict=True)]) for look in tries]
    scored = [coverage(poses, fov, reach) for poses in films]
    best = int(np.argmax(scored))
    return Walk(fov, films[best]) if np.isfinite(scored[best]) else None


def floor_area(room: RandomRoom) -> float:
    """Square metres of the main space, furniture ignored."""
    (low_x, low_y, _), (high_x, high_y, _) = room.bounds
    x, y = np.meshgrid(np.arange(low_x, high_x, CELL), np.arange(low_y, high_y, CELL))
    return float(room.inside(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 1e-3)])).sum() * CELL**2)


def tour(air: FreeAir, rng: Rng, length: float) -> np.ndarray:
    """(K, 2) points of a closed route past far corners of the free air, laps added until it is `length` metres long."""
    laps: list[np.ndarray] = []
    total = 0.0
    while total < length:
        stops = far_apart(air, rng)
        lap = np.concatenate([air.places[air.route(a, b)] for a, b in zip(stops, np.roll(stops, -1), strict=True)])
        lap = lap if not laps else np.roll(lap, -int(np.linalg.norm(lap - laps[-1][-1], axis=1).argmin()), axis=0)
        if laps:  # the way from one lap to the next
            laps.append(air.places[air.route(air.nearest(laps[-1][-1]), air.nearest(lap[0]))])
        laps.append(lap)
        total = np.linalg.norm(np.diff(np.concatenate(laps), axis=0), axis=1).sum()
    return np.concatenate(laps)


def far_apart(air: FreeAir, rng: Rng) -> np.ndarray:
    """Places far from one another in walking distance, in the order of a short round trip."""
    chosen = [int(rng.integers(len(air.places)))]
    roomy = 0.5 + 0.5 * np.clip(air.clearance / (CLEARANCE + 0.25), 0, 1)
    apart = [dijkstra(air.links, directed=False, indices=chosen[0])]
    for _ in range(WAYPOINTS - 1):
        chosen.append(int(np.argmax(np.min(apart, axis=0) * roomy * rng.uniform(0.7, 1.0, len(air.places)))))
        apart.append(dijkstra(air.links, directed=False, indices=chosen[-1]))
    table = np.array(apart)[:, chosen]
    return np.array(chosen)[shorter(list(range(len(chosen))), table)]


def shorter(order: list[int], table: np.ndarray) -> list[int]:
    """A round trip made shorter by turning stretches of it around (2-opt)."""

    def trip(stops: list[int]) -> float:
        return float(table[stops, np.roll(stops, -1)].sum())

    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                other = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
                if trip(other) < trip(order) - 1e-9:
                    order, improved = other, True
    return order


def steady(route: np.ndarray, count: int, rng: Rng) -> np.ndarray:
    """(count, 2) places along a smoothed route at a walking pace that varies a little."""
    dense = at_lengths(route, np.arange(0.0, lengths(route)[-1], 0.02))
    for _ in range(4):
        dense = gaussian_filter1d(dense, 0.12 / 0.02, axis=0, mode="nearest")
        dense = at_lengths(dense, np.arange(0.0, lengths(dense)[-1], 0.02))
    total = min(float(lengths(dense)[-1]), PACE[1] * (count - 1))
    time = np.linspace(0, 1, count)
    pace = 1 + 0.15 * np.sin(2 * np.pi * (rng.uniform(1.5, 3.5) * time + rng.random()))
    along = np.concatenate([[0.0], np.cumsum((pace[1:] + pace[:-1]) / 2)])
    return at_lengths(dense, total * along / max(along[-1], 1e-9))


def lengths(route: np.ndarray) -> np.ndarray:
    """(K,) metres from the start along a polyline (K, 2)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1))])


def at_lengths(route: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Points of a polyline (K, 2) at metres from its start."""
    marks = lengths(route)
    return np.column_stack([np.interp(along, marks, route[:, axis]) for axis in (0, 1)])


def waves(count: int, rng: Rng, shortest: float, longest: float) -> np.ndarray:
    """(count,) slow wave with an extreme of about 1: two sines with periods in photos."""
    photo = np.arange(count)
    first, second = (
        np.sin(2 * np.pi * (photo / np.exp(rng.uniform(*np.log([shortest, longest]))) + rng.random())) for _ in range(2)
    )
    return 0.7 * first + 0.3 * second


def held(ground: np.ndarray, rng: Rng) -> np.ndarray:
    """(F, 3) camera centres over places on the floor (F, 2): a height that changes slowly, and the hand's wobble."""
    count = len(ground)
    height = (LOW + HIGH) / 2 + 0.11 * waves(count, rng, 30, 90)
    wobble = np.stack([0.008 * waves(count, rng, 7, 14) for _ in range(3)], 1) + rng.normal(0, 0.003, (count, 3))
    centres = np.column_stack([ground, height]) + wobble
    centres[:, 2] = np.clip(centres[:, 2], LOW, HIGH)
    return centres


def gaze(air: FreeAir, centres: np.ndarray, rng: Rng) -> np.ndarray:
    """(F, 3) yaw, pitch and roll: across the room, sweeping from side to side and up and down."""
    count = len(centres)
    across = air.places.mean(axis=0) - centres[:, :2]
    # near the middle of the room the direction to it says nothing: the neighbours' longer arrows prevail
    across = gaussian_filter1d(across, 4.0, axis=0, mode="nearest")
    yaw = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))
    yaw = yaw + rng.uniform(0.3, 1.3) * waves(count, rng, 30, 110)
    yaw = slowed(gaussian_filter1d(yaw, 2.0, mode="nearest"))
    pitch = np.radians(rng.uniform(-14, -4) + rng.uniform(8, 20) * waves(count, rng, 18, 60))
    hand = np.radians(0.7) * np.stack([waves(count, rng, 6, 12) for _ in range(3)], 1)
    hand += rng.normal(0, np.radians(0.25), (count, 3))
    return np.column_stack([yaw, pitch, np.zeros(count)]) + hand


def slowed(yaw: np.ndarray) -> np.ndarray:
    """The angles followed at no more than `FASTEST_TURN` a photo."""
    followed = yaw.copy()
    for index in range(1, len(yaw)):
        followed[index] = followed[index - 1] + np.clip(yaw[index] - followed[index - 1], -FASTEST_TURN, FASTEST_TURN)
    return followed


def coverage(poses: np.ndarray, fov: float, reach: Reach) -> float:
    """How much is seen from several places: cells of surface, each counted up to `SEEN_ENOUGH` views; -inf if a
    fifth of the photos looks at something close before the lens."""
    half = np.tan(np.radians(fov) / 2)
    x, y = np.meshgrid(np.linspace(-0.95, 0.95, GRID[0]) * half, np.linspace(-0.95, 0.95, GRID[1]) * 0.75 * half)
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], 1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    directions = np.einsum("fij,rj->fri", poses[:, :3, :3], rays)
    origins = np.broadcast_to(poses[:, None, :3, 3], directions.shape)
    length = reach(origins.reshape(-1, 3), directions.reshape(-1, 3)).reshape(directions.shape[:2])
    median = np.median(length, axis=1)
    if np.mean(median < TOO_NEAR) > 0.2:
        return -np.inf
    hits = np.isfinite(length)
    cells = np.floor((origins + np.where(hits, length, 0)[..., None] * directions) / CELLS).astype(np.int64)
    photo = np.broadcast_to(np.arange(len(poses))[:, None], hits.shape)
    views = np.unique(np.column_stack([cells[hits], photo[hits]]), axis=0)
    _, seen = np.unique(views[:, :3], axis=0, return_counts=True)
    return float(np.minimum(seen, SEEN_ENOUGH).sum() * (1 - np.mean(median < 1.0)))
