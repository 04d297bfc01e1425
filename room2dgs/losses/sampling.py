"""Values of an image between its pixels, and patches around them."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import grid_sample


def bilinear(image: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Values at points of the image; outside it those of its border.

    Args:
        image: (H, W).
        x, y: (M, P) pixels, centres at +0.5.

    Returns:
        (M, P), differentiable in the image and in the points.
    """
    height, width = image.shape
    # without aligned corners torch's coordinates count as ours do, from edge to edge
    grid = torch.stack([x * (2 / width) - 1, y * (2 / height) - 1], dim=-1)
    return grid_sample(image[None, None], grid[None], padding_mode="border", align_corners=False)[0, 0]


def patch_offsets(size: int, dtype: torch.dtype = torch.float32) -> Tensor:
    """(size * size, 2) offsets (x, y) of a square patch's pixels from its middle, row by row."""
    reach = torch.arange(size, dtype=dtype) - size // 2
    y, x = torch.meshgrid(reach, reach, indexing="ij")
    return torch.stack([x.flatten(), y.flatten()], dim=-1)


def patches_at(image: Tensor, column: Tensor, row: Tensor, size: int) -> Tensor:
    """(M, size * size) square patches around pixels that are at least size // 2 from the border.

    Args:
        image: (H, W).
        column, row: (M,) int64.
    """
    reach = torch.arange(size) - size // 2
    around = (reach[:, None] * image.shape[1] + reach).flatten()
    return image.flatten()[(row * image.shape[1] + column)[:, None] + around]
