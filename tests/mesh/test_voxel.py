"""Voxels follow what the photos resolve."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.geometry.camera import Camera
from room2dgs.mesh.voxel import with_voxel
from tests.mesh.test_tsdf import make_config


def camera(focal: float) -> Camera:
    K = np.array([[focal, 0, 160], [0, focal, 120], [0, 0, 1.0]])
    return Camera(K, 320, 240, np.eye(4))


@pytest.mark.parametrize(("focal", "side_m"), [(585.0, 0.01), (292.5, 0.017), (266.0, 0.019), (120.0, 0.02)])
def test_two_pixels_between_one_and_two_centimetres(focal, side_m):
    few_others = [camera(focal)] * 3 + [camera(2000.0)]
    assert with_voxel(make_config(voxel_m=None), few_others).voxel_m == pytest.approx(side_m)


def test_a_given_side_stays():
    config = make_config(voxel_m=0.005)
    assert with_voxel(config, [camera(100.0)]) is config
