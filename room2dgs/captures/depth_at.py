"""Values of a depth map between its pixels."""

from __future__ import annotations

import numpy as np

ONE_SURFACE = 1.05  # four pixels are of one where their depths differ by less


def depth_at(depth: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """(...) float32 metres: as `inverse_depth_at`; 0 = invalid, or outside of the map.

    The nearest pixel's alone is half a pixel off wherever a map is made smaller by an even factor, always to the same
    side: floors come nearer, ceilings go away.

    Args:
        depth: (H, W) metres, 0 = invalid.
        pixel: (..., 2) in the map, pixel centres at +0.5; anything that is not finite is outside.
    """
    height, width = depth.shape
    x, y = np.moveaxis(np.nan_to_num(pixel, nan=-1.0, posinf=-1.0, neginf=-1.0), -1, 0)
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    inverse = np.divide(1, depth.astype(np.float64), out=np.zeros(depth.shape), where=depth > 0)
    found = inverse_depth_at(inverse, np.clip(x - 0.5, 0, width - 1), np.clip(y - 0.5, 0, height - 1))
    return np.divide(1, found, out=np.zeros(found.shape), where=inside & (found > 0)).astype(np.float32)


def inverse_depth_at(inverse_depth: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(...) 1/metres: between four pixels of one surface, whose inverse depth is linear in the image, else the
    nearest pixel's; 0 = invalid.

    Args:
        inverse_depth: (H, W) 1/metres, 0 = invalid.
        x, y: (...) in the map, pixel centres at integers; beyond the outermost centres by half a pixel at most.
    """
    height, width = inverse_depth.shape
    left = np.clip(x, 0, max(width - 2, 0)).astype(np.int64)
    top = np.clip(y, 0, max(height - 2, 0)).astype(np.int64)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    x, y = x - left, y - top
    four = np.stack([inverse_depth[row, column] for row in (top, below) for column in (left, right)])
    upper, lower = four[0] + x * (four[1] - four[0]), four[2] + x * (four[3] - four[2])
    nearest = np.where(y > 0.5, np.where(x > 0.5, four[3], four[2]), np.where(x > 0.5, four[1], four[0]))
    one_surface = (four.min(axis=0) > 0) & (four.max(axis=0) < ONE_SURFACE * four.min(axis=0))
    return np.where(one_surface, upper + y * (lower - upper), nearest)
