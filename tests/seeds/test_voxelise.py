import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from room2dgs.errors import InputError
from room2dgs.geometry.cells import HALF_RANGE
from room2dgs.seeds.voxelise import cell_centres, cell_keys, voxelise

clouds = st.integers(1, 60).flatmap(
    lambda n: arrays(np.float64, (n, 3), elements=st.floats(-50, 50, allow_nan=False, width=64))
)
voxel_sizes = st.floats(1e-3, 2.0)


def colors(n):
    return np.random.default_rng(n).integers(0, 256, (n, 3)).astype(np.uint8)


@given(clouds, voxel_sizes)
def test_each_point_lies_in_the_cell_whose_centre_it_gets(xyz, voxel_m):
    centres = cell_centres(cell_keys(xyz, voxel_m), voxel_m)
    assert np.abs(xyz - centres).max() <= voxel_m / 2 + 1e-12 * 50


@given(clouds, voxel_sizes, st.randoms(use_true_random=False))
def test_order_of_points_does_not_change_a_bit(xyz, voxel_m, random):
    rgb = colors(len(xyz))
    shuffled = list(range(len(xyz)))
    random.shuffle(shuffled)
    for a, b in zip(voxelise(xyz, rgb, voxel_m), voxelise(xyz[shuffled], rgb[shuffled], voxel_m), strict=True):
        np.testing.assert_array_equal(a, b)


@given(clouds, voxel_sizes)
def test_one_seed_for_each_occupied_cell(xyz, voxel_m):
    voxels = voxelise(xyz, colors(len(xyz)), voxel_m)
    cells = {tuple(cell) for cell in np.floor(xyz / voxel_m).astype(int)}
    assert len(voxels.centres) == len(cells)
    assert {tuple(cell) for cell in np.floor(voxels.centres / voxel_m).astype(int)} == cells


def test_centre_is_half_a_voxel_from_the_corner_on_both_sides_of_the_origin():
    centres = voxelise(np.array([[0.01, -0.01, 0.0]]), colors(1), 0.1).centres
    np.testing.assert_allclose(centres, [[0.05, -0.05, 0.05]], atol=1e-15)


def test_colour_and_place_are_means_over_the_cell():
    xyz = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [5.0, 5.0, 5.0]])
    rgb = np.array([[0, 10, 255], [100, 20, 255], [7, 7, 7]], dtype=np.uint8)
    voxels = voxelise(xyz, rgb, 1.0)
    np.testing.assert_allclose(voxels.rgb, [[50, 15, 255], [7, 7, 7]])
    np.testing.assert_allclose(voxels.means, [[0.2, 0.1, 0.1], [5, 5, 5]])


@settings(max_examples=20)
@given(st.sampled_from([-HALF_RANGE, HALF_RANGE - 1]), st.integers(0, 2))
def test_the_ends_of_the_range_survive_packing(cell, axis):
    xyz = np.zeros((1, 3))
    xyz[0, axis] = cell + 0.5
    np.testing.assert_allclose(cell_centres(cell_keys(xyz, 1.0), 1.0)[0, axis], cell + 0.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, float(HALF_RANGE), -float(HALF_RANGE) - 1])
def test_points_out_of_range_are_refused_with_the_setting(bad):
    with pytest.raises(InputError, match=r"seeds\.voxel_m"):
        voxelise(np.array([[0.0, bad, 0.0]]), colors(1), 1.0)


def test_no_points_is_an_input_error():
    with pytest.raises(InputError, match="no points"):
        voxelise(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), 0.1)
