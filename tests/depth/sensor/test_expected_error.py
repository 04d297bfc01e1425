"""Expected errors of a depth camera: distance, angle, edges, reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.depth.sensor.error import EDGE_PX, EDGE_SHARE, LATERAL_PX, expected_error
from room2dgs.geometry.camera import Camera

FOCAL, WIDTH, HEIGHT = 100.0, 80, 60
K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
CAMERA = Camera(K, WIDTH, HEIGHT, np.eye(4))
SETTINGS = replace(
    load_config(["scene.path=a", "out=b"]).prior.depth.sensor, min_m=0.5, max_m=5.0, error_m=0.004, error_per_m2=0.003
)


def flat(z: float) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), z, np.float32)


def plane(slope: float, z: float = 2.0) -> np.ndarray:
    """z-depth of the plane Z = z + slope X: its normal and the optical axis are atan(slope) apart."""
    x = (np.arange(WIDTH) + 0.5 - K[0, 2]) / FOCAL
    return np.broadcast_to(z / (1 - slope * x), (HEIGHT, WIDTH)).astype(np.float32)


@pytest.mark.parametrize("z", [0.6, 1.0, 2.0, 4.5])
def test_a_surface_that_faces_the_camera_has_the_error_of_its_distance(z):
    at_the_middle = expected_error(flat(z), CAMERA, SETTINGS)[HEIGHT // 2, WIDTH // 2]
    assert at_the_middle == pytest.approx(0.004 + 0.003 * z**2, rel=1e-3)


@pytest.mark.parametrize("slope", [0.5, 1.0, 2.0])
def test_a_slanted_surface_adds_what_its_depth_changes_over_a_pixel(slope):
    depth = plane(slope)
    error = expected_error(depth, CAMERA, SETTINGS)
    row, column = HEIGHT // 2, WIDTH // 2
    change = (depth[row, column + 1] - depth[row, column - 1]) / 2  # metres a pixel
    z = depth[row, column]
    assert error[row, column] == pytest.approx(np.hypot(0.004 + 0.003 * z**2, LATERAL_PX * change), rel=0.05)
    assert error[row, column] > expected_error(flat(2.0), CAMERA, SETTINGS)[row, column]


def test_near_a_depth_edge_the_error_is_a_share_of_the_jump_and_fades():
    depth = flat(1.0)
    depth[:, 40:] = 3.0
    row = expected_error(depth, CAMERA, SETTINGS)[HEIGHT // 2]
    away = [row[39 - step] for step in range(EDGE_PX + 3)]  # on the near side, from the edge outwards
    assert away[0] == pytest.approx(EDGE_SHARE * 2.0, rel=0.02)
    assert all(np.diff(away[: EDGE_PX + 2]) < 0)
    assert away[EDGE_PX + 2] < 0.02  # farther, nothing is left of it
    assert row[40] == pytest.approx(EDGE_SHARE * 2.0, rel=0.05)


def test_neither_a_steep_plane_nor_a_hole_in_a_flat_one_is_an_edge():
    depth = plane(2.0)
    steep = expected_error(depth, CAMERA, SETTINGS)
    change = np.gradient(depth, axis=1)
    inside = (depth > 0.8) & (depth < 4.0)
    bound = np.hypot(0.004 + 0.003 * depth**2, LATERAL_PX * change * (1 + (depth / 4) ** 2))
    assert (steep < 1.5 * bound)[inside].all()
    hollow = flat(2.0)
    hollow[20:30, 20:30] = 0
    assert expected_error(hollow, CAMERA, SETTINGS)[19, 25] < 0.05


def test_what_is_invalid_or_out_of_reach_is_not_known_at_all():
    depth = flat(2.0)
    depth[0], depth[1], depth[2] = 0.0, 0.49, 5.01
    error = expected_error(depth, CAMERA, SETTINGS)
    assert np.isinf(error[:3]).all() and np.isfinite(error[3:]).all()
    assert error.dtype == np.float32


def test_the_error_belongs_to_the_size_at_which_the_camera_measures():
    small = expected_error(plane(1.0)[::2, ::2], CAMERA.resized(WIDTH // 2, HEIGHT // 2), SETTINGS)
    large = expected_error(plane(1.0), CAMERA, SETTINGS)
    slanted_small, slanted_large = (np.sqrt(e**2 - 0.016**2) for e in (small[15, 20], large[30, 40]))
    assert slanted_small == pytest.approx(2 * slanted_large, rel=0.1)  # its pixels are twice as wide
