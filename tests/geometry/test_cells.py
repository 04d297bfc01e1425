"""Cells of points are numpy's unique rows."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.geometry.cells import cells_of


@given(st.integers(0, 2**32 - 1), st.integers(0, 200), st.integers(1, 3), st.sampled_from([0.3, 1.0, 1e3]))
def test_cells_are_unique_rows(seed, count, axes, side):
    place = np.random.default_rng(seed).normal(size=(count, axes)) * 2
    first, cell = cells_of(place, side)
    _, index, inverse = np.unique(
        np.floor(place / side).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    np.testing.assert_array_equal(first, index)
    np.testing.assert_array_equal(cell, inverse.reshape(-1))
