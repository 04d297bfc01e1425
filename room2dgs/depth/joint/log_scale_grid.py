"""Log-scale grids: a smooth field over each view's image whose exp multiplies the depth map."""

from __future__ import annotations

import torch
from torch import Tensor


def at(grid: Tensor, view: Tensor, place: Tensor) -> Tensor:
    """Bilinear values.

    Args:
        grid: (V, R, C), knots on the image's border and inside, evenly.
        view: (N,) int64.
        place: (N, 2) x and y as shares of the image's width and height, 0..1; outside counts as the border.

    Returns:
        (N,), differentiable with respect to the grid and the places.
    """
    rows, columns = grid.shape[1:]
    x = (place[:, 0] * (columns - 1)).clamp(0, columns - 1)
    y = (place[:, 1] * (rows - 1)).clamp(0, rows - 1)
    left, top = x.detach().floor().clamp(max=columns - 2), y.detach().floor().clamp(max=rows - 2)
    right_share, lower_share = x - left, y - top
    first = (view * rows + top.long()) * columns + left.long()
    knots = grid.reshape(-1)
    upper = knots[first] * (1 - right_share) + knots[first + 1] * right_share
    lower = knots[first + columns] * (1 - right_share) + knots[first + columns + 1] * right_share
    return upper * (1 - lower_share) + lower * lower_share


def finer(grid: Tensor, rows: int, columns: int) -> Tensor:
    """The same field on (V, rows, columns) knots."""
    return torch.nn.functional.interpolate(grid[:, None], size=(rows, columns), mode="bilinear", align_corners=True)[
        :, 0
    ]


def whole(grid: Tensor, height: int, width: int) -> Tensor:
    """(R, C) to (height, width): the field at every pixel's centre of one view."""
    y = (torch.arange(height, dtype=torch.float32) + 0.5) / height
    x = (torch.arange(width, dtype=torch.float32) + 0.5) / width
    place = torch.stack([x.expand(height, width), y[:, None].expand(height, width)], dim=-1).reshape(-1, 2)
    return at(grid[None], torch.zeros(len(place), dtype=torch.int64), place).reshape(height, width)


def smoothness(grid: Tensor, stiffness: Tensor | None = None) -> Tensor:
    """Bending energy of a thin plate: mean squared second differences; 0 for a linear field. Scalar.

    Args:
        stiffness: (V, R, C) weight of each difference, taken at its middle (of the mixed ones, at the first); None: 1.
    """
    stiffness = torch.ones_like(grid) if stiffness is None else stiffness
    down = grid[:, 2:] - 2 * grid[:, 1:-1] + grid[:, :-2]
    along = grid[:, :, 2:] - 2 * grid[:, :, 1:-1] + grid[:, :, :-2]
    across = grid[:, 1:, 1:] - grid[:, 1:, :-1] - grid[:, :-1, 1:] + grid[:, :-1, :-1]
    parts = ((down, stiffness[:, 1:-1], 1), (along, stiffness[:, :, 1:-1], 1), (across, stiffness[:, :-1, :-1], 2))
    means = ((part.square() * stiff).mean() * weight for part, stiff, weight in parts if part.numel())
    return sum(means, start=grid.new_zeros(()))
