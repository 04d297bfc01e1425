import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.seeds.neighbourhood import local_normals, spacing


def plane_points(normal, rng, count=200):
    basis = np.linalg.svd(normal[None])[2][1:]
    return rng.uniform(-1, 1, (count, 2)) @ basis


@given(st.integers(0, 1000))
def test_points_of_a_plane_give_its_normal_on_the_cameras_side(seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    points = plane_points(normal, rng)
    for side in (3.0, -3.0):
        found = local_normals(points, points[:20], 12, side * normal)
        np.testing.assert_allclose(found, np.tile(np.sign(side) * normal, (20, 1)), atol=1e-6)


def test_repeated_points_do_not_hide_the_plane():
    rng = np.random.default_rng(0)
    points = plane_points(np.array([0.0, 0.0, 1.0]), rng, 30)
    crowded = np.concatenate([points, np.repeat(points[:1], 100, axis=0)])
    found = local_normals(crowded, points[:1], 8, np.array([0.0, 0.0, 5.0]))
    np.testing.assert_allclose(found, [[0, 0, 1]], atol=1e-9)


def test_points_on_a_line_get_the_normal_across_it_that_faces_the_camera():
    points = np.stack([np.linspace(0, 1, 10), np.zeros(10), np.zeros(10)], axis=1)
    found = local_normals(points, points, 5, np.array([4.0, 0.0, 3.0]))
    np.testing.assert_allclose(found, np.tile([0, 0, 1.0], (10, 1)), atol=1e-9)


@pytest.mark.parametrize("copies", [1, 5])
def test_a_lone_place_faces_the_camera(copies):
    found = local_normals(np.zeros((copies, 3)), np.zeros((1, 3)), 12, np.array([0.0, 3.0, 4.0]))
    np.testing.assert_allclose(found, [[0, 0.6, 0.8]], atol=1e-12)


def test_a_lone_place_at_the_camera_still_has_a_unit_normal():
    found = local_normals(np.zeros((1, 3)), np.zeros((1, 3)), 12, np.zeros(3))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)


def test_spacing_is_the_mean_to_three_neighbours_and_not_to_itself():
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0), [0.0], indexing="ij"), -1).reshape(-1, 3)
    values = spacing(grid, 0.0, 10.0).reshape(5, 5)
    assert values[2, 2] == pytest.approx(1.0)
    assert values[0, 0] == pytest.approx((1 + 1 + 2**0.5) / 3)


def test_spacing_is_clamped_and_defined_for_few_positions():
    pair = np.array([[0.0, 0, 0], [0.5, 0, 0]])
    assert spacing(pair, 0.1, 0.2).tolist() == [0.2, 0.2]
    assert spacing(pair, 0.7, 0.9).tolist() == [0.7, 0.7]
    assert spacing(pair, 0.1, 0.9).tolist() == [0.5, 0.5]
    assert spacing(pair[:1], 0.1, 0.3).tolist() == [0.3]
