"""A camera that moves while it takes a photo: blur and rolling shutter."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

PHOTO_S = 0.5  # seconds from one photo of a walk to the next
TREMOR = np.radians(2.5)  # a hand's own turning, radians a second about each axis
TYPICAL_M = 2.0  # of surfaces, for the length of a blur
SHORTEST = 0.25  # of a phone's longest exposure
MOST_SAMPLES = 8
SAMPLE_PX = 1.0  # of a blur, for each sample of it
Shade = Callable[[np.ndarray, np.ndarray], np.ndarray]


class Motion(NamedTuple):
    """How a camera moves.

    Attributes:
        velocity: (3,) metres a second, world.
        turning: (3,) rotation vector a second, the camera's own axes.
    """

    velocity: np.ndarray
    turning: np.ndarray

    def at(self, world_from_cam: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3, 3) rotations and (N, 3) centres of world_from_cam at times (N,) from that of the pose."""
        turned = Rotation.from_rotvec(seconds[:, None] * self.turning).as_matrix()
        return world_from_cam[:3, :3] @ turned, world_from_cam[:3, 3] + seconds[:, None] * self.velocity


def motions(poses: np.ndarray, rng: np.random.Generator) -> list[Motion]:
    """Of each photo of a walk (F, 4, 4): from the photo before it to the one after it, and a hand's tremor."""
    last = len(poses) - 1
    found = []
    for index in range(len(poses)):
        before, after = poses[max(index - 1, 0)], poses[min(index + 1, last)]
        seconds = PHOTO_S * max(min(index + 1, last) - max(index - 1, 0), 1)
        turned = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).as_rotvec()
        found.append(Motion((after[:3, 3] - before[:3, 3]) / seconds, turned / seconds + rng.normal(0, TREMOR, 3)))
    return found


def exposure_times(photos: int, longest_s: float, rng: np.random.Generator) -> np.ndarray:
    """(photos,) seconds."""
    return longest_s * SHORTEST ** rng.uniform(0, 1, photos)


def blur_px(motion: Motion, focal: float, exposure_s: float) -> float:
    """About how far the picture moves during an exposure."""
    speed = np.linalg.norm(motion.turning[:2]) + np.linalg.norm(motion.velocity) / TYPICAL_M
    return float(focal * exposure_s * speed)


def moving_photo(
    shade: Shade,
    focal: float,
    world_from_cam: np.ndarray,
    motion: Motion,
    size: tuple[int, int],
    exposure_s: float,
    readout_s: float,
) -> np.ndarray:
    """(H, W, 3) float32 radiance, averaged over each row's exposure; the pose is that of the middle row's middle.

    Args:
        shade: origins and directions (N, 3) of rays -> their radiance (N, 3).
        focal: pixels; the principal point is the image's middle.
        size: width and height.
        exposure_s, readout_s: how long a row is exposed, and from the first row to the last; 0: not at all.
    """
    width, height = size
    # at least four rays a pixel, which lie differently in each sample
    samples = int(np.clip(np.ceil(blur_px(motion, focal, exposure_s) / SAMPLE_PX), 4, MOST_SAMPLES))
    total = np.zeros((height * width, 3), np.float32)
    rows = (np.arange(height) + 0.5) / height - 0.5
    for sample in range(samples):
        # the additive recurrence of the plastic number covers the pixel evenly
        within = np.mod(0.5 + (sample + 1) * np.array([0.7548776662, 0.5698402910]), 1)
        seconds = readout_s * rows + exposure_s * ((sample + 0.5) / samples - 0.5)
        rotation, centre = motion.at(world_from_cam, seconds)
        x = (np.arange(width) + within[0] - width / 2) / focal
        y = (np.arange(height) + within[1] - height / 2) / focal
        along = y[:, None] * rotation[:, :, 1] + rotation[:, :, 2]
        directions = x[None, :, None] * rotation[:, None, :, 0] + along[:, None]
        origins = np.broadcast_to(centre[:, None], directions.shape)
        total += shade(origins.reshape(-1, 3).astype(np.float32), directions.reshape(-1, 3).astype(np.float32))
    return (total / samples).reshape(height, width, 3)
