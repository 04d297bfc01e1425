"""What surfels say of themselves."""

from __future__ import annotations

import torch

from room2dgs.splat.types import Surfels


def surfels(centers, degree=0):
    count = len(centers)
    return Surfels(
        torch.tensor(centers).reshape(count, 3), torch.zeros(count, 4), torch.ones(count, 2), torch.ones(count),
        torch.zeros(count, (degree + 1) ** 2, 3),
    )  # fmt: skip


def test_they_say_how_many_where_and_how_fine():
    corners = [[-1.0, 0.0, 2.5], [3.256, -4.0, 0.0], [float("nan")] * 3]
    assert (
        repr(surfels(corners, 2))
        == "Surfels(3, from (-1.00, -4.00, 0.00) to (3.26, 0.00, 2.50) m, colours of degree 2)"
    )
    assert str(surfels(corners)).endswith("colours of degree 0)")


def test_none_have_no_bounds():
    assert repr(surfels([])) == "Surfels(0)"
    assert repr(surfels([[float("inf")] * 3])) == "Surfels(1)"
