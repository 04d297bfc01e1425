"""Values of an image between its pixels, and patches around them."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from room2dgs.geometry.arguments import check_tensor
from room2dgs.losses.checks import check_images, check_patch


def bilinear(image: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Values at points of the image; outside it those of its border.

    Args:
        image: (H, W).
        x, y: (M, P) pixels, centres at +0.5.

    Returns:
        (M, P), differentiable in the image and in the points.

    Raises:
        TypeError, ValueError: no tensors in floating point; an empty image; points of different shapes.
    """
    check_images(image=image)
    for name, points in (("x", x), ("y", y)):
        check_tensor(name, points, tuple(x.shape) if isinstance(x, Tensor) and x.ndim == 2 else (None, None))
    x, y = x.to(image.dtype), y.to(image.dtype)
    height, width = image.shape
    # what lies beyond the border has its value anyway; torch's backward reads far outside for what no index can hold
    x, y = _near(x, width), _near(y, height)
    # without aligned corners torch's coordinates count as ours do, from edge to edge
    grid = torch.stack([x * (2 / width) - 1, y * (2 / height) - 1], dim=-1)
    return grid_sample(image[None, None], grid[None], padding_mode="border", align_corners=False)[0, 0]


def _near(x: Tensor, size: int) -> Tensor:
    return torch.where(x.isnan(), 0.0, x.clamp(-1.0, size + 1.0))


def patch_offsets(size: int, dtype: torch.dtype = torch.float32) -> Tensor:
    """(size * size, 2) offsets (x, y) of a square patch's pixels from its middle, row by row.

    Raises:
        TypeError, ValueError: no side of a patch.
    """
    size = check_patch(size)
    reach = torch.arange(size, dtype=dtype) - size // 2
    y, x = torch.meshgrid(reach, reach, indexing="ij")
    return torch.stack([x.flatten(), y.flatten()], dim=-1)


def patches_at(image: Tensor, column: Tensor, row: Tensor, size: int) -> Tensor:
    """(M, size * size) square patches around pixels that are at least size // 2 from the border.

    Args:
        image: (H, W).
        column, row: (M,) int64.

    Raises:
        TypeError, ValueError: no such tensors; a patch that leaves the image (checked on the CPU alone).
    """
    check_images(image=image)
    size = check_patch(size)
    for name, index, end in (("column", column, image.shape[1]), ("row", row, image.shape[0])):
        if not isinstance(index, Tensor) or index.dtype not in (torch.int32, torch.int64):
            raise TypeError(f"{name} is no tensor of whole numbers")
        if index.ndim != 1 or index.shape != column.shape or index.device.type == "meta":
            raise ValueError(f"{name} has shape {tuple(index.shape)}; column and row are (M,)")
        if index.device.type == "cpu" and len(index):
            low, high = (value.item() for value in torch.aminmax(index))
            if low < size // 2 or high >= end - (size - 1) // 2:
                raise ValueError(f"patches of {size} pixels at {name} {low} to {high} leave the image")
    reach = torch.arange(size) - size // 2
    around = (reach[:, None] * image.shape[1] + reach).flatten()
    return image.flatten()[(row * image.shape[1] + column)[:, None] + around]
