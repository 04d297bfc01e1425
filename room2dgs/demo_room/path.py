"""A hand-held walk around the middle of the room, looking across it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from room2dgs.demo_room.layout import SIZE

CLEARANCE = 0.35  # metres between the camera and any surface
FRAMES_A_LAP = 28


def camera_path(
    frames: int,
    distance: Callable[[np.ndarray], np.ndarray],
    rng: np.random.Generator,
    frames_a_lap: int = FRAMES_A_LAP,
) -> np.ndarray:
    """(frames, 4, 4) float64 world_from_cam, metres, OpenCV axes.

    The walk is an ellipse around the table; the gaze crosses the room while it sweeps up and down, so that
    walls, floor, ceiling and furniture are seen from several places. The ellipse shrinks until the clearance
    holds.

    Args:
        frames: number of poses.
        distance: metres from points (N, 3) to the nearest surface.
        rng: draws the start, the sway and the hand's jitter.
        frames_a_lap: of the frames, once around; the hand trembles as far in as long, whatever their number.

    Raises:
        RuntimeError: no ellipse keeps the clearance; a mistake of the room's layout.
    """
    laps = max(1.0, frames / frames_a_lap)
    time = np.arange(frames) / max(1, frames - 1)
    angle = rng.uniform(0, 2 * np.pi) + 2 * np.pi * laps * time
    sway = 1 + 0.10 * np.sin(1.37 * angle + rng.uniform(0, 2 * np.pi))
    tremor = min(1.0, FRAMES_A_LAP / frames_a_lap)
    jitter = hand(angle, rng, 0.012, tremor)
    height = 1.48 + 0.10 * np.sin(0.61 * angle + rng.uniform(0, 2 * np.pi))
    yaw = angle + np.pi + 0.45 * np.sin(0.83 * angle + rng.uniform(0, 2 * np.pi))
    pitch = -0.20 + 0.40 * np.sin(0.56 * angle + rng.uniform(0, 2 * np.pi))
    turn = hand(angle, rng, np.radians(0.8), tremor)
    for scale in np.arange(1.0, 0.3, -0.03):
        ring = np.stack([1.35 * np.cos(angle), 0.90 * np.sin(angle)], 1) * (scale * sway)[:, None]
        centre = np.column_stack([SIZE[:2] / 2 + ring, height]) + jitter
        if distance(centre).min() >= CLEARANCE:
            angles = np.column_stack([yaw, pitch, np.zeros(frames)]) + turn
            return np.stack([pose(at, *look) for at, look in zip(centre, angles, strict=True)])
    raise RuntimeError(f"no walk keeps {CLEARANCE} m from the furniture")


def hand(angle: np.ndarray, rng: np.random.Generator, amplitude: float, tremor: float = 1.0) -> np.ndarray:
    """(N, 3) jitter of a hand: two slow waves and a little tremor, about `amplitude` in deviation."""
    phase, speed = rng.uniform(0, 2 * np.pi, (2, 3)), rng.uniform([[3.0], [6.0]], [[5.0], [9.0]], (2, 3))
    slow = np.sin(speed[0] * angle[:, None] + phase[0]) + 0.6 * np.sin(speed[1] * angle[:, None] + phase[1])
    return amplitude * (slow + 0.4 * tremor * rng.standard_normal((len(angle), 3)))


def pose(centre: np.ndarray, yaw: float, pitch: float, roll: float) -> np.ndarray:
    """(4, 4) world_from_cam of a camera at `centre` looking along (yaw, pitch), then rolled; radians."""
    forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    down = np.cross(forward, right)
    matrix = np.eye(4)
    matrix[:3, 0] = np.cos(roll) * right + np.sin(roll) * down
    matrix[:3, 1] = np.cos(roll) * down - np.sin(roll) * right
    matrix[:3, 2] = forward
    matrix[:3, 3] = centre
    return matrix
