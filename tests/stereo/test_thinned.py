"""One depth of each block."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.stereo.thinned import thinned


def slanted(width: int, height: int) -> np.ndarray:
    """A floor: inverse depth is linear in the image."""
    row, column = np.mgrid[:height, :width]
    return (1 / (0.3 + 0.002 * (column + 0.5) + 0.004 * (row + 0.5))).astype(np.float32)


@pytest.mark.parametrize("step", [1, 2, 3, 4, 5])
def test_a_block_has_the_depth_of_its_centre(step):
    depth = slanted(43, 31)
    some = thinned(depth, np.full(depth.shape, 5, np.uint8), step)
    assert len(some.pixel) == (43 // step) * (31 // step)
    np.testing.assert_allclose((some.pixel / step) % 1, 0.5)
    np.testing.assert_allclose(some.depth, 1 / (0.3 + some.pixel @ [0.002, 0.004]), rtol=1e-6)
    assert (some.num_consistent == 5).all()


def test_across_an_edge_the_pixel_with_most_views_stands_for_the_block_at_its_own_place():
    depth = np.full((4, 4), 2.0, np.float32)
    depth[:, 1:] = 3.0
    depth[2, 2:] = 0
    num_consistent = np.full((4, 4), 3, np.uint8)
    num_consistent[1, 1], num_consistent[3, 3] = 6, 2
    some = thinned(depth, num_consistent, 2)
    np.testing.assert_allclose(some.pixel, [[1.5, 1.5], [3.0, 1.0], [0.5, 2.5], [2.5, 3.5]])
    np.testing.assert_allclose(some.depth, [3, 3, 2, 3])
    assert some.num_consistent.tolist() == [6, 3, 3, 3]


@settings(deadline=None)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_what_comes_out_was_there(width, height, step, seed):
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random((height, width)) < 0.6, rng.uniform(1, 1.2, (height, width)), 0).astype(np.float32)
    num_consistent = np.where(depth > 0, rng.integers(1, 9, depth.shape), 0).astype(np.uint8)
    some = thinned(depth, num_consistent, step)
    assert len(some.pixel) <= (width // step) * (height // step) and (some.num_consistent > 0).all()
    block = (some.pixel // step).astype(int)
    assert len(np.unique(block, axis=0)) == len(block)
    for (column, row), z in zip(block, some.depth, strict=True):
        of_block = depth[row * step : (row + 1) * step, column * step : (column + 1) * step]
        of_block = of_block[of_block > 0]
        assert of_block.min() * 0.9999 <= z <= of_block.max() * 1.0001
