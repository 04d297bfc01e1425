"""Hand-held views of a random room."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from room2dgs.demo_room.path import pose
from room2dgs.tools.random_rooms.layout import RandomRoom

CLEARANCE = 0.25  # metres between the camera and any surface
NEAR = 0.3  # most of a picture must be farther than this
Distance = Callable[[np.ndarray], np.ndarray]
Rng = np.random.Generator


def random_views(room: RandomRoom, distance: Distance, rng: Rng, count: int) -> list[tuple[float, np.ndarray]]:
    """Draws views that keep their clearance and look at something.

    Most look across the room, some straight at one wall or into a corner, some at a piece from close by.

    Args:
        room: where to stand.
        distance: points (N, 3) -> (N,) metres to the nearest surface.
        count: number of views; fewer only if the room has hardly any free air.

    Returns:
        For each view its horizontal field of view in degrees and world_from_cam (4, 4), metres, OpenCV axes.
    """
    views: list[tuple[float, np.ndarray]] = []
    for attempt in range(24):
        lenient = attempt >= 8  # a crammed or tiny room: take what keeps half the clearance
        for fov, world_from_cam, reach in candidates(room, distance, rng, 4 * count + 8, lenient):
            if len(views) < count and (accepted(rng, reach) or (lenient and np.median(reach) > NEAR)):
                views.append((fov, world_from_cam))
        if len(views) >= count:
            break
    return views


def candidates(
    room: RandomRoom, distance: Distance, rng: Rng, count: int, lenient: bool = False
) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Up to `count` views with clearance (half of it, if lenient) and the lengths of rays through each."""
    low, high = room.bounds
    centres = rng.uniform(low, high, (count, 3))
    tall = np.where(rng.random(count) < 0.75, rng.normal(1.45, 0.17, count), rng.uniform(0.5, 2.2, count))
    centres[:, 2] = np.clip(tall, 0.4, room.height - 0.3)
    centres = centres[room.inside(centres) & ~room.blocked(centres)]
    if not len(centres):
        return []
    centres = centres[distance(centres) >= (0.5 if lenient else 1.0) * CLEARANCE]
    if not len(centres):
        return []
    fovs, poses, starts, rays = [], [], [], []
    for centre in centres:
        fov, world_from_cam = draw(rng, centre, room.bounds)
        fovs.append(fov)
        poses.append(world_from_cam)
        rays.append(picture_rays(fov) @ world_from_cam[:3, :3].T)
        starts.append(np.broadcast_to(centre, rays[-1].shape))
    reach = marched(distance, np.concatenate(starts), np.concatenate(rays)).reshape(len(centres), -1)
    return list(zip(fovs, poses, reach, strict=True))


def draw(rng: Rng, centre: np.ndarray, bounds: np.ndarray) -> tuple[float, np.ndarray]:
    """A field of view (degrees, horizontal) and world_from_cam (4, 4) at a place."""
    fov = float(np.clip(rng.normal(65, 7), 45, 95)) if rng.random() < 0.7 else rng.uniform(45, 95)
    towards = rng.uniform(*bounds) - centre
    yaw = np.arctan2(towards[1], towards[0]) if rng.random() < 0.6 else rng.uniform(-np.pi, np.pi)
    if rng.random() < 0.12:  # straight at a wall
        yaw = np.round(yaw / (np.pi / 2)) * np.pi / 2 + rng.normal(0, 0.05)
    kind = rng.random()
    if kind < 0.85:
        pitch = rng.normal(-11, 11)
    elif kind < 0.95:
        pitch = rng.uniform(-70, -20)
    else:
        pitch = rng.uniform(0, 40)
    roll = rng.normal(0, 1.8) if rng.random() < 0.85 else rng.uniform(-15, 15)
    if rng.random() < 0.05:
        roll += rng.choice([-90, 90])
    return fov, pose(centre, yaw, np.radians(np.clip(pitch, -70, 40)), np.radians(roll))


def picture_rays(fov: float) -> np.ndarray:
    """(35, 3) unit rays in the camera through a 7 x 5 grid over a 4:3 picture."""
    half = np.tan(np.radians(fov) / 2)
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 7) * half, np.linspace(-0.9, 0.9, 5) * 0.75 * half)
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], 1)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def marched(distance: Distance, starts: np.ndarray, rays: np.ndarray, steps: int = 16, far: float = 12.0) -> np.ndarray:
    """(N,) lengths of rays to the first surface, by sphere tracing; short ones are accurate, long ones roughly."""
    length = np.zeros(len(rays))
    active = np.arange(len(rays))
    for _ in range(steps):
        step = distance(starts[active] + length[active, None] * rays[active])
        length[active] += step
        active = active[(step > 0.02) & (length[active] < far)]
        if not len(active):
            break
    return length


def accepted(rng: Rng, reach: np.ndarray) -> bool:
    """Whether a view with these ray lengths is worth a picture; close and dull ones pass at times."""
    if np.mean(reach < NEAR + 0.05) > 0.15 or np.median(reach) < 0.5:
        return False
    median, spread = np.median(reach), np.percentile(reach, 90) / np.percentile(reach, 10)
    chance = np.clip((median - 0.3) / 1.7, 0.12, 1.0)
    if spread < 1.5:  # one wall or one corner
        chance *= 0.6
    return bool(rng.random() < chance)
