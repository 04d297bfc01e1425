import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.geometry.cells import HALF_RANGE
from room2dgs.seeds.hierarchy import cells_of, coarser, in_grid, level_edge
from room2dgs.seeds.voxelise import cell_centres, cell_keys

VOXEL = 0.02


def test_edges_are_sixteen_four_and_one_voxels():
    assert [level_edge(VOXEL, level, 3) for level in range(3)] == pytest.approx([0.32, 0.08, 0.02])


@given(
    st.lists(st.tuples(*[st.integers(-HALF_RANGE, HALF_RANGE - 1)] * 3), min_size=1, max_size=20),
    st.integers(1, 4),
    st.data(),
)
def test_a_coarse_cell_is_the_floor_of_the_fine_one_on_both_sides_of_the_origin(cells, levels, data):
    level = data.draw(st.integers(0, levels - 1))
    ratio = 4 ** (levels - 1 - level)
    fine = cell_keys((np.array(cells) + 0.5) * VOXEL, VOXEL)
    expected = np.floor_divide(cells, ratio)
    edge = level_edge(VOXEL, level, levels)
    np.testing.assert_allclose(cell_centres(coarser(fine, level, levels), edge), (expected + 0.5) * edge, rtol=1e-9)


def test_the_finest_level_is_the_grid_itself():
    keys = cell_keys(np.random.default_rng(0).normal(size=(50, 3)), VOXEL)
    np.testing.assert_array_equal(coarser(keys, 2, 3), keys)


@given(st.lists(st.integers(-3, 3), max_size=40), st.randoms())
def test_cells_hold_each_item_once_and_means_are_those_of_their_items(keys, random):
    keys = np.array(keys, dtype=np.int64)
    values = np.array([[random.uniform(-1, 1) for _ in range(2)] for _ in keys]).reshape(-1, 2)
    cells = cells_of(keys)
    assert sorted(cells.order) == list(range(len(keys)))
    np.testing.assert_array_equal(cells.keys, np.unique(keys))
    expected = [values[keys == key].mean(axis=0) for key in cells.keys]
    np.testing.assert_allclose(cells.mean(values), np.reshape(expected, (-1, 2)), atol=1e-12)
    chosen = cells.keys > 0
    some = cells.only(chosen)
    np.testing.assert_array_equal(keys[some.order], np.sort(keys[keys > 0]))
    np.testing.assert_allclose(some.mean(values), cells.mean(values)[chosen], atol=1e-12)


def test_what_has_no_key_is_not_in_the_grid():
    limit = HALF_RANGE * VOXEL
    xyz = np.array([[0, 0, 0], [limit, 0, 0], [-limit, 0, 0], [0, np.nan, 0], [0, 0, np.inf]])
    inside = in_grid(xyz, VOXEL)
    np.testing.assert_array_equal(inside, [True, False, True, False, False])
    cell_keys(xyz[inside], VOXEL)  # refuses what is outside
