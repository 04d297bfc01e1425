"""Smooth fields over images."""

from __future__ import annotations

import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.depth.joint.log_scale_grid import at, finer, smoothness, whole

sides = st.integers(2, 9)


def linear(rows: int, columns: int, a: float, b: float, c: float) -> torch.Tensor:
    y, x = torch.linspace(0, 1, rows, dtype=torch.float64), torch.linspace(0, 1, columns, dtype=torch.float64)
    return (a + b * x[None, :] + c * y[:, None])[None]


@settings(deadline=None)
@given(sides, sides, sides, sides)
def test_a_linear_field_is_met_between_its_knots_and_stays_one_when_refined(rows, columns, more_rows, more_columns):
    grid = finer(linear(rows, columns, 0.3, -0.7, 0.2), more_rows, more_columns)
    place = torch.rand(50, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    expected = 0.3 - 0.7 * place[:, 0] + 0.2 * place[:, 1]
    torch.testing.assert_close(at(grid, torch.zeros(50, dtype=torch.int64), place), expected)
    assert smoothness(grid).item() < 1e-24


def test_knots_of_other_views_and_beyond_the_border_do_not_mix():
    grid = torch.stack([torch.full((3, 4), 1.0), torch.full((3, 4), 2.0)])
    place = torch.tensor([[1.0, 1.0], [0.0, 0.0], [1.5, -0.5]])
    assert at(grid, torch.tensor([0, 1, 0]), place).tolist() == [1.0, 2.0, 1.0]


def test_pixels_are_met_at_their_centres():
    field = whole(linear(2, 2, 0.0, 1.0, 0.0)[0], height=2, width=4)
    torch.testing.assert_close(field[0], torch.tensor([0.125, 0.375, 0.625, 0.875], dtype=torch.float64))


def test_gradients_of_values_and_places_are_exact():
    torch.manual_seed(0)
    grid = torch.randn(2, 3, 4, dtype=torch.float64, requires_grad=True)
    place = torch.rand(6, 2, dtype=torch.float64, requires_grad=True)
    view = torch.tensor([0, 1, 0, 1, 1, 0])
    assert torch.autograd.gradcheck(lambda g, p: at(g, view, p), (grid, place))
    assert torch.autograd.gradcheck(smoothness, (grid,))


def test_curvature_costs():
    grid = torch.zeros(1, 5, 5)
    grid[0, 2, 2] = 1.0
    assert smoothness(grid) > 0
