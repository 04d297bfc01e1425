"""Numbers as text, against Python's own formatting."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.export import text_rows as module
from room2dgs.export.text_rows import text_rows


def test_numbers_are_those_of_format(monkeypatch):
    """Signs, zeros before and behind the point, rounding up to one more digit; rows of several parts in their order."""
    monkeypatch.setattr(module, "ROWS", 7)
    drawn = np.random.default_rng(0).normal(size=(40, 2)) * 10.0 ** np.arange(-20, 20)[:, None].clip(-8, 6)
    hard = [[0.0, -0.0], [9.9999996, -0.9999996], [0.0000004, -123.0], [1e5, 0.1], [-0.5, 12.000001]]
    values = np.concatenate([hard, drawn])
    expected = "".join("v {:.6f} {:.6f}\n".format(*(np.round(row, 6) + 0.0)) for row in values.tolist())
    assert text_rows("v {} {}", values, decimals=6).decode() == expected


@pytest.mark.parametrize("kind", [np.int32, np.uint32, np.int64])
def test_whole_numbers_have_no_point_and_no_zeros_before_them(kind):
    values = np.array([[1, 10, 0], [99, 100, 2_345_678]], kind)
    assert text_rows("f {}/{} {}", values) == b"f 1/10 0\nf 99/100 2345678\n"
    assert text_rows("f {}/{} {}", values[:0]) == b""
    with pytest.raises(ValueError, match="2 fields for 3 columns"):
        text_rows("f {} {}", values)
