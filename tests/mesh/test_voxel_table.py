"""Blocks are found by their keys, forget nothing, and are meshed apart as if they had been meshed together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.geometry.cells import keys_of
from room2dgs.mesh import marching, voxel_table
from room2dgs.mesh.clean import clean
from room2dgs.mesh.marching import extracted
from room2dgs.mesh.voxel_table import BLOCK, VoxelTable, block_coordinates

PLACES = st.lists(st.tuples(*[st.integers(-(2**20), 2**20 - 1)] * 3), min_size=1, max_size=50)


@given(places=PLACES)
def test_keys_say_where_a_block_is_and_rise_with_it(places):
    blocks = np.array(sorted(set(places)))
    keys = keys_of(blocks)
    assert (np.diff(keys) > 0).all() and (block_coordinates(keys) == blocks).all()


def test_a_table_of_many_parts_forgets_nothing(monkeypatch):
    monkeypatch.setattr(voxel_table, "ROWS", 100)
    random, table, seen = np.random.default_rng(0), VoxelTable(), {}
    for _ in range(30):
        keys = np.unique(random.integers(0, 2000, 150))
        asked = np.zeros(len(keys), bool)
        for part, which, rows in table.in_parts(keys):
            assert not asked[which].any() and len(np.unique(rows)) == len(rows)
            asked[which] = True
            part.views[rows] += 1
            part.color[rows, 0] = keys[which]
        assert asked.all()
        seen |= {one: seen.get(one, 0) + 1 for one in keys.tolist()}
    assert table.keys.tolist() == sorted(seen) and len(table.parts) == -(-len(seen) // 100)
    for part, which, rows in table.in_parts(table.keys):
        assert ([seen[key] for key in table.keys[which].tolist()] == part.views[rows].T).all()
        np.testing.assert_array_equal(part.color[rows, 0], table.keys[which])


def test_neighbours_touch_a_block_and_are_there():
    blocks = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3), axis=-1).reshape(-1, 3)
    table, middle = VoxelTable(), keys_of(np.array([[0, 0, 0]]))
    table.rows_of(np.sort(keys_of(blocks[blocks[:, 2] < 1])))
    near = block_coordinates(table.with_neighbours(middle))
    assert len(near) == 18 and np.abs(near).max() == 1 and near[:, 2].max() == 0


def wavy(size: int = 5) -> VoxelTable:
    """A wavy sheet through a cube of blocks about the origin, on which some voxels' distances are exactly 0."""
    blocks = np.stack(np.meshgrid(*[np.arange(-size, size)] * 3), axis=-1).reshape(-1, 3)
    table, inner = VoxelTable(), np.arange(BLOCK**3)
    offset = np.stack([inner % BLOCK, inner // BLOCK % BLOCK, inner // BLOCK**2], axis=1)
    for part, which, rows in table.in_parts(np.sort(keys_of(blocks))):
        place = block_coordinates(table.keys[which])[:, None] * BLOCK + offset
        distance = place[..., 2] - np.round(2 * np.sin(place[..., 0] / 7) + 3 * np.cos(place[..., 1] / 9)) / 2
        part.tsdf[rows] = np.clip(distance / 4, -1, 1)
        part.weight[rows], part.views[rows] = 1, 2
        part.color[rows] = np.repeat(place.sum(axis=2) % 200, 3, axis=1)
    return table


@pytest.mark.parametrize("together", [37, 100, 400])
def test_blocks_meshed_apart_give_the_same_mesh(monkeypatch, together):
    origin = np.array([0.3, -2.0, 1.0])
    raw = extracted(wavy(), 0.02, origin, 1.0)
    monkeypatch.setattr(marching, "TOGETHER", together)
    apart = extracted(wavy(), 0.02, origin, 1.0)
    assert len(apart.faces) == len(raw.faces) > 10_000
    whole, apart = clean(raw), clean(apart)
    np.testing.assert_array_equal(apart.vertices, whole.vertices)
    np.testing.assert_array_equal(apart.faces, whole.faces)
    np.testing.assert_array_equal(apart.visual.vertex_colors, whole.visual.vertex_colors)


def test_voxels_that_too_few_views_have_seen_have_no_surface():
    assert len(extracted(wavy(2), 0.02, np.zeros(3), 2.0).faces) and not len(
        extracted(wavy(2), 0.02, np.zeros(3), 3.0).faces
    )
    assert not len(extracted(VoxelTable(), 0.02, np.zeros(3), 1.0).faces)


def test_a_table_that_was_meshed_holds_nothing_any_more():
    table = wavy(2)
    assert len(extracted(table, 0.02, np.zeros(3), 1.0).faces)
    assert not len(table.keys) and not len(table.rows) and not table.parts
