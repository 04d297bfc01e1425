import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.seeds.grow import Parents, grow
from room2dgs.seeds.hierarchy import coarser
from room2dgs.seeds.voxelise import cell_keys

VOXEL, LEVELS, THETA = 0.02, 3, 2e-4


def parents(centres, gradients, seeds=((50.0, 50.0, 50.0),), **changes) -> Parents:
    """Surfels of 1 cm that face z; the only seed is far away."""
    centres = np.asarray(centres, dtype=np.float64).reshape(-1, 3)
    count = len(centres)
    values = {
        "seeds": np.asarray(seeds, dtype=np.float64),
        "centres": centres,
        "normals": np.tile([0.0, 0.0, 1.0], (count, 1)),
        "scales": np.full(count, 0.01),
        "rgb": np.full((count, 3), 0.5),
        "gradients": np.asarray(gradients, dtype=np.float32),
        "known": np.ones(count, bool),
    }
    return Parents(**values | changes)


def grown_from(them: Parents, draws=None, per_seed=4, max_spacing_m=0.1):
    return grow(them, VOXEL, LEVELS, THETA, max_spacing_m, per_seed, draws)


def test_the_threshold_doubles_with_each_finer_level():
    # empty space: a cell of each level that is reached; the coarser new seeds occupy one fine cell of theirs
    for gradient, levels in ((1.9e-4, []), (2.1e-4, [0]), (4.1e-4, [0, 1]), (8.1e-4, [0, 1, 2])):
        assert grown_from(parents([[0.005, 0.005, 0.005]], [gradient])).level.tolist() == levels


def test_a_cells_mean_decides_not_its_largest():
    two = [[0.005, 0.005, 0.005], [0.006, 0.006, 0.006]]
    assert len(grown_from(parents(two, [3.8e-4, 0.0]))) == 0
    grown = grown_from(parents(two, [3.8e-4, 0.4e-4]))
    assert grown.level.tolist() == [0] and grown.gradient == pytest.approx([2.1e-4])


def test_a_cell_with_a_seed_gets_none_but_its_empty_children_do():
    seed = [[0.19, 0.19, 0.19]]  # in the surfel's 32 cm cell, in another one of 8 cm
    assert grown_from(parents([[0.005] * 3], [1e-3], seed)).level.tolist() == [1, 2]
    assert len(grown_from(parents([[0.005] * 3], [1e-3], [[0.015] * 3]))) == 0  # in its very voxel


def test_surfels_seldom_seen_have_no_say():
    two = [[0.005, 0.005, 0.005], [1.005, 0.005, 0.005]]
    grown = grown_from(parents(two, [1e-3, 1e-3], known=np.array([False, True])))
    assert (grown.seeds.surface[:, 0] > 1).all() and len(grown) == 3


def test_a_new_seed_takes_after_the_surfels_of_its_cell():
    centres = [[0.001, 0.002, 0.003], [0.015, 0.006, 0.007], [3.0, 3.0, 3.0]]
    normals = np.array([[0.6, 0.0, 0.8], [-0.6, 0.0, -0.8], [0.0, 1.0, 0.0]])  # the first two: one plane, two sides
    rgb = np.array([[0.2, 0.4, 0.6], [0.4, 0.6, 0.8], [1.0, 1.0, 1.0]])
    grown = grown_from(parents(centres, [1e-3, 1e-3, 0.0], normals=normals, rgb=rgb))
    assert grown.level.tolist() == [0, 1, 2]
    np.testing.assert_allclose(grown.seeds.positions, [[0.16] * 3, [0.04] * 3, [0.01] * 3], atol=1e-6)
    for b in range(3):
        np.testing.assert_allclose(grown.seeds.surface[b], [0.008, 0.004, 0.005])
        assert abs(grown.seeds.normals[b] @ [0.6, 0.0, 0.8]) == pytest.approx(1.0)
        np.testing.assert_allclose(grown.seeds.rgb[b], [0.3, 0.5, 0.7])
        assert grown.family.only(np.arange(3) == b).order.tolist() == [0, 1]


def test_a_patch_is_bounded_by_cell_limit_and_parents():
    # discs of 1 cm, 4 a seed: a patch of 2 cm
    assert grown_from(parents([[0.005] * 3], [1e-3])).seeds.spacing == pytest.approx([0.02, 0.02, 0.02])
    wide = parents([[0.005] * 3], [1e-3], scales=np.array([1.0]))
    assert grown_from(wide).seeds.spacing == pytest.approx([0.1, 0.08, 0.02])
    tiny = parents([[0.005] * 3], [1e-3], scales=np.array([1e-5]))
    assert grown_from(tiny).seeds.spacing == pytest.approx([VOXEL / 4] * 3)


def test_the_largest_gradients_are_kept_under_a_cap():
    centres = [[x + 0.005, 0.005, 0.005] for x in range(5)]
    grown = grown_from(parents(centres, [3e-4, 2.5e-4, 3.9e-4, 2.1e-4, 3.5e-4]))
    some = grown.largest(2)
    assert len(grown) == 5 and len(some) == 2
    np.testing.assert_allclose(some.seeds.surface[:, 0], [2.005, 4.005])
    assert some.family.order.tolist() == [2, 4]
    assert len(grown.largest(0)) == 0 and grown.largest(9) is grown


def test_half_of_the_coarse_and_more_of_the_finer_new_seeds_survive():
    far = np.arange(4000)[:, None] * [0.32, 0.0, 0.0] + 0.005
    grown = [grown_from(parents(far, np.full(4000, 1e-3)), np.random.default_rng(5)) for _ in range(2)]
    shares = np.bincount(grown[0].level) / 4000
    assert shares == pytest.approx([0.5, 0.75, 0.875], abs=0.03)
    np.testing.assert_array_equal(grown[0].seeds.positions, grown[1].seeds.positions)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32), st.integers(1, 60), st.integers(0, 20), st.booleans())
def test_no_cell_of_a_level_gets_a_second_seed(seed, surfels, seeds, random_survival):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(-0.5, 0.5, (surfels, 3)) / 0.01) * 0.01  # many on the borders of cells
    first = rng.uniform(-0.5, 0.5, (seeds, 3)).astype(np.float32).astype(np.float64)
    _, index = np.unique(cell_keys(first, VOXEL), return_index=True)
    there = first[index]
    for _ in range(3):  # one adjustment after another
        them = parents(xyz, rng.uniform(0, 2e-3, surfels), there)
        grown = grown_from(them, rng if random_survival else None)
        before = cell_keys(there, VOXEL)
        for level in range(LEVELS):
            mine = coarser(cell_keys(grown.seeds.positions[grown.level == level], VOXEL), level, LEVELS)
            assert len(np.unique(mine)) == len(mine)
            assert not np.isin(mine, coarser(before, level, LEVELS)).any()
            before = np.concatenate([before, cell_keys(grown.seeds.positions[grown.level == level], VOXEL)])
        # as a decoder stores them
        there = np.concatenate([there, grown.seeds.positions]).astype(np.float32).astype(np.float64)
        assert len(np.unique(cell_keys(there, VOXEL))) == len(there)
