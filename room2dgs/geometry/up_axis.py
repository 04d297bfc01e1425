"""The up axis from cameras and surface normals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera

PRIOR = 0.05  # weight of "up is against the mean image y axis", for captures that hardly turn
SNAP_DEG = 20.0  # surface normals within this angle of the first guess refine it


def up_axis(cameras: Sequence[Camera], normals: np.ndarray, prior: float = PRIOR) -> np.ndarray:
    """(3,) unit vector, world, pointing up.

    A hand-held camera pitches and turns but hardly rolls, so its x axes are nearly horizontal: up is the direction in
    which they vary least. Normals of floors and ceilings refine it.

    Args:
        normals: (N, 3) unit normals of area samples, either sign; may be empty.
        prior: weight of "up is against the mean image y axis", which decides if the cameras hardly turn.
    """
    right = np.stack([camera.cam_from_world[0, :3] for camera in cameras])
    against_y = -np.stack([camera.cam_from_world[1, :3] for camera in cameras]).mean(axis=0)
    length = np.linalg.norm(against_y)
    mean_up = against_y / length if length > 0 else np.array([0.0, 0.0, 1.0])
    spread = right.T @ right / len(right) + prior * (np.eye(3) - np.outer(mean_up, mean_up))
    up = np.linalg.eigh(spread)[1][:, 0]
    up = up if up @ mean_up >= 0 else -up
    cosine = normals @ up
    level = np.abs(cosine) > np.cos(np.radians(SNAP_DEG))
    if level.any():
        refined = (normals[level] * np.sign(cosine[level])[:, None]).mean(axis=0)
        up = refined / np.linalg.norm(refined)
    return up
