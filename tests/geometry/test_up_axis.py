"""Which way is up, from how people hold cameras."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.up_axis import up_axis


@pytest.mark.parametrize("seed", range(4))
def test_up_is_found_in_any_world_frame_from_pitched_cameras(make, seed):
    rng = np.random.default_rng(seed)
    world = Rotation.random(random_state=seed).as_matrix()
    cameras = []
    for turn in rng.uniform(0, 2 * np.pi, 12):
        forward = [np.cos(turn), np.sin(turn), rng.uniform(-0.6, 0.1)]  # looking down more than up
        camera = make.camera_at((0, 0, 0), np.array(forward) / np.linalg.norm(forward))
        pose = camera.cam_from_world.copy()
        pose[:3, :3] = pose[:3, :3] @ world.T
        cameras.append(Camera(camera.K, camera.width, camera.height, pose))
    normals = np.concatenate([np.repeat([[0, 0, 1.0]], 50, 0), np.repeat([[0, 0.6, 0.8]], 50, 0)]) @ world.T
    assert up_axis(cameras, normals) @ world[:, 2] > 1 - 1e-9
    assert up_axis(cameras, np.zeros((0, 3))) @ world[:, 2] > np.cos(np.radians(8))
