import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.seeds.seeds import seed_points
from room2dgs.seeds.spawn import spawn

CAMERA = np.array([[0.0, 0.0, -5.0]])


def settings(*overrides):
    return load_config(["scene.path=x", "out=x", "seeds.init=points", "seeds.per_seed=1", *overrides]).seeds


def test_every_point_is_a_seed_where_it_lies_as_wide_as_its_neighbours_are_far():
    xyz = np.array([[0.0, 0, 0], [0.001, 0, 0], [0.002, 0, 0], [0.4, 0.3, 0]])  # three of them in one voxel
    rgb = np.array([[0, 51, 255]] * 4, np.uint8)
    seeds = seed_points(xyz, rgb, CAMERA, settings())
    np.testing.assert_array_equal(seeds.positions, xyz)
    expected = np.sqrt(np.mean([np.sum((xyz[0] - other) ** 2) for other in xyz[1:]]))
    assert seeds.spacing[0] == pytest.approx(expected) and expected > 0.1  # wider than seeds.max_scale_m
    surfels = spawn(seeds, 1, 0.1, 0)
    np.testing.assert_allclose(surfels.scales[:, 0], np.repeat(seeds.spacing[:, None], 2, 1), rtol=1e-6)
    np.testing.assert_array_equal(surfels.offsets, 0)
    np.testing.assert_allclose(seeds.rgb, [[0, 0.2, 1]] * 4)


def test_they_face_anywhere_and_the_same_way_for_the_same_seed():
    xyz = np.random.default_rng(0).uniform(-1, 1, (4000, 3))
    rgb = np.zeros((4000, 3), np.uint8)
    seeds = [seed_points(xyz, rgb, CAMERA, settings(), random_seed) for random_seed in (1, 1, 2)]
    np.testing.assert_array_equal(seeds[0].normals, seeds[1].normals)
    assert not np.array_equal(seeds[0].normals, seeds[2].normals)
    np.testing.assert_allclose(np.linalg.norm(seeds[0].normals, axis=1), 1)
    np.testing.assert_allclose(seeds[0].normals.T @ seeds[0].normals / 4000, np.eye(3) / 3, atol=0.03)
    np.testing.assert_allclose(seeds[0].normals.mean(0), 0, atol=0.05)


def test_coincident_points_have_a_size_and_outliers_a_limit():
    xyz = np.concatenate([np.zeros((4, 3)), [[100.0, 0, 0]]])
    seeds = seed_points(xyz, np.zeros((5, 3), np.uint8), CAMERA, settings())
    np.testing.assert_allclose(seeds.spacing, [1e-3] * 4 + [1.0])


@pytest.mark.parametrize("xyz", [np.zeros((0, 3)), np.array([[0.0, np.nan, 0.0]])])
def test_points_that_cannot_be_used_are_refused(xyz):
    with pytest.raises(InputError, match="point"):
        seed_points(xyz, np.zeros((len(xyz), 3), np.uint8), CAMERA, settings())
