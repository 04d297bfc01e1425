"""A posed camera that no convention's mistake leaves unchanged."""

import numpy as np
import pytest

from room2dgs.geometry.camera import Camera


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.fixture
def camera() -> Camera:
    """fx != fy, the principal point off the centre, a turned and shifted pose; 45 x 38 pixels."""
    pose = np.eye(4)
    pose[:3, :3] = rotation([0.3, 1.0, -0.5], 2.1)
    pose[:3, 3] = [0.7, -1.3, 0.4]
    return Camera(np.array([[40.0, 0, 20.3], [0, 47.0, 21.1], [0, 0, 1]]), 45, 38, pose)
