"""Masks at other sizes: a pixel counts when none of it is hidden."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.image_files import whole_at


@pytest.mark.parametrize("width", [160, 320, 640])
def test_a_mask_that_hides_nothing_hides_nothing_at_any_size(width):
    """ScanNet's photos: areas of a pixel add up to a little less than 1."""
    assert whole_at(np.ones((968, 1296), bool), (width, round(width * 968 / 1296))).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(20, 300), st.integers(20, 300), st.floats(0.1, 1.0), st.integers(0, 2**32 - 1))
def test_one_hidden_pixel_hides_what_it_touches_and_nothing_else(width, height, scale, seed):
    rng = np.random.default_rng(seed)
    row, column = rng.integers(height), rng.integers(width)
    mask = np.ones((height, width), bool)
    mask[row, column] = False
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    hidden = ~whole_at(mask, size)
    rows = np.flatnonzero(hidden.any(axis=1)) * height / size[1]
    columns = np.flatnonzero(hidden.any(axis=0)) * width / size[0]
    assert hidden.any()
    tall, wide = height / size[1], width / size[0]
    assert (rows > row - tall - 0.01).all() and (rows < row + 1.01).all()
    assert (columns > column - wide - 0.01).all() and (columns < column + 1.01).all()
