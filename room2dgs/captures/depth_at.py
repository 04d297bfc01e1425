"""A depth map between its pixels."""

from __future__ import annotations

import numpy as np

ONE_SURFACE = 1.05  # four pixels are of one where their depths differ by less


def depth_at(depth: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """(...) float32 metres: between four pixels of one surface, whose inverse depth is linear in the image, else the
    nearest pixel's; 0 = invalid, or outside of the map.

    The nearest pixel's alone is half a pixel off wherever a map is made smaller by an even factor, always to the same
    side: floors come nearer, ceilings go away.

    Args:
        depth: (H, W) metres, 0 = invalid.
        pixel: (..., 2) in the map, pixel centres at +0.5; anything that is not finite is outside.
    """
    height, width = depth.shape
    x, y = np.moveaxis(np.nan_to_num(pixel, nan=-1.0, posinf=-1.0, neginf=-1.0), -1, 0)
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    x, y = np.clip(x - 0.5, 0, width - 1), np.clip(y - 0.5, 0, height - 1)
    left, top = x.astype(np.int64), y.astype(np.int64)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    x, y = x - left, y - top
    four = np.stack([depth[top, left], depth[top, right], depth[below, left], depth[below, right]])
    nearest = np.where(y < 0.5, np.where(x < 0.5, four[0], four[1]), np.where(x < 0.5, four[2], four[3]))
    one_surface = (four.min(axis=0) > 0) & (four.max(axis=0) < ONE_SURFACE * four.min(axis=0))
    inverse = 1 / np.where(one_surface, four, 1).astype(np.float64)
    upper, lower = inverse[0] + x * (inverse[1] - inverse[0]), inverse[2] + x * (inverse[3] - inverse[2])
    found = np.where(one_surface, 1 / (upper + y * (lower - upper)), nearest)
    return np.where(inside, found, 0).astype(np.float32)
