"""Rigid poses as 4x4 matrices; every pose is named b_from_a."""

from __future__ import annotations

import numpy as np


def rigid_pose(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """(4, 4) float64 with b = rotation @ a + translation.

    Args:
        rotation: (3, 3).
        translation: (3,) metres.
    """
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = translation
    return pose


def inverse_pose(b_from_a: np.ndarray) -> np.ndarray:
    """a_from_b (4, 4) float64 of a rigid pose; its rotation is transposed, not inverted numerically."""
    rotation = b_from_a[:3, :3].T
    return rigid_pose(rotation, -rotation @ b_from_a[:3, 3])


def pose_at(rotation: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """cam_from_world (4, 4) float64 of a camera that stands at `centre`.

    Args:
        rotation: (3, 3) of cam_from_world: its rows are the camera's axes in the world.
        centre: (3,) metres, world frame.
    """
    return rigid_pose(rotation, -rotation @ centre)
