"""A surface that goes on where no photo looks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.seeds.continued import continued
from room2dgs.seeds.depth_seeds import Surface
from room2dgs.seeds.voxelise import cell_centres, cell_keys

VOXEL_M = 0.05
K = np.array([[100.0, 0, 50.0], [0, 100.0, 50.0], [0, 0, 1.0]])
CAMERA = Camera(K, 100, 100, np.eye(4))  # sees 1 m x 1 m of a wall at 1 m


def wall(low: float = -0.475, high: float = 0.5) -> Surface:
    """The wall z = 1, x and y from low to high; red grows with x."""
    across = np.arange(low, high, VOXEL_M)
    x, y = (values.reshape(-1) for values in np.meshgrid(across, across))
    xyz = np.stack([x, y, np.full(x.shape, 1.01)], axis=1)
    rgb = np.stack([0.5 + 0.5 * x, 0 * x, 0 * x], axis=1)
    return Surface(cell_centres(cell_keys(xyz, VOXEL_M), VOXEL_M), xyz, np.tile([0.0, 0.0, -1.0], (len(x), 1)), rgb)


def test_a_wall_goes_on_in_its_plane_as_far_as_asked_and_only_where_no_photo_looks():
    seen = wall()
    whole = continued(seen, [CAMERA], VOXEL_M, 0.3)
    for before, after in zip(seen, whole, strict=True):
        np.testing.assert_array_equal(before, after[: len(before)])
    new = whole.xyz[len(seen.xyz) :]
    np.testing.assert_allclose(new[:, 2], 1.01, atol=1e-9)
    reach = np.abs(new[:, :2]).max(axis=1)
    assert reach.min() > 0.44  # the photo's depth may end before the photo does
    assert 0.7 < reach.max() < 0.475 + 0.3 * 1.01
    np.testing.assert_allclose(whole.normals, np.tile([0.0, 0.0, -1.0], (len(whole.xyz), 1)), atol=1e-9)
    assert len(np.unique(whole.cells, axis=0)) == len(whole.cells)
    np.testing.assert_array_equal(cell_keys(whole.cells, VOXEL_M), cell_keys(whole.xyz, VOXEL_M))
    # no hole wider than a step, no two pieces in one place
    probes = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))
    probes = np.concatenate([probes, np.full((500, 1), 1.01)], axis=1)
    assert cKDTree(whole.xyz).query(probes)[0].max() < VOXEL_M
    assert cKDTree(whole.xyz).query(new, k=2)[0][:, 1].min() >= 0.5 * VOXEL_M


def test_a_slanted_wall_goes_on_without_holes():
    turn = Rotation.from_euler("xyz", [35.0, 20.0, 10.0], degrees=True).as_matrix()
    cam_from_world = np.eye(4)
    cam_from_world[:3, :3] = turn.T
    across = np.arange(-0.47, 0.47, 0.01)
    x, y = (values.reshape(-1) for values in np.meshgrid(across, across))
    xyz = np.stack([x, y, np.ones(x.shape)], axis=1) @ turn.T
    keys, first = np.unique(cell_keys(xyz, VOXEL_M), return_index=True)
    normals = np.tile(turn @ [0.0, 0.0, -1.0], (len(keys), 1))
    seen = Surface(cell_centres(keys, VOXEL_M), xyz[first], normals, np.full((len(keys), 3), 0.5))
    whole = continued(seen, [Camera(K, 100, 100, cam_from_world)], VOXEL_M, 0.3)
    np.testing.assert_allclose(whole.xyz @ turn[:, 2], 1.0, atol=1e-9)
    probes = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))
    probes = np.concatenate([probes, np.ones((500, 1))], axis=1) @ turn.T
    assert cKDTree(whole.xyz).query(probes)[0].max() < 1.2 * VOXEL_M
    assert len(np.unique(whole.cells, axis=0)) == len(whole.cells)


def test_new_pieces_have_the_colour_beside_them():
    whole = continued(wall(), [CAMERA], VOXEL_M, 0.2)
    assert whole.rgb[whole.xyz[:, 0] > 0.55][:, 0].min() > 0.6
    assert whole.rgb[whole.xyz[:, 0] < -0.55][:, 0].max() < 0.4


def test_what_another_photo_looks_through_stays_free():
    aside = np.eye(4)
    aside[0, 3] = -1.0  # at x = 1: sees x from 0.5 to 1.5
    cameras = [CAMERA, Camera(K, 100, 100, aside)]
    new = continued(wall(), cameras, VOXEL_M, 0.2).xyz[len(wall().xyz) :]
    assert not ((new[:, 0] > 0.57) & (np.abs(new[:, 1]) < 0.43)).any()
    assert (new[:, 0] < -0.5).any()


@pytest.mark.parametrize("beyond_m", [0.0, 0.02])
def test_less_than_half_a_step_is_nothing(beyond_m):
    assert len(continued(wall(), [CAMERA], VOXEL_M, beyond_m).xyz) == len(wall().xyz)


def test_no_surface_stays_none_and_the_same_input_gives_the_same_bits():
    none = Surface(*np.zeros((4, 0, 3)))
    assert len(continued(none, [CAMERA], VOXEL_M, 0.5).xyz) == 0
    first, again = (continued(wall(), [CAMERA], VOXEL_M, 0.5) for _ in range(2))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
