"""One depth of each block of stereo's pixels: that at the block's centre."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

ONE_SURFACE = 1.05  # pixels are of one where their depths differ by less


class Thinned(NamedTuple):
    """Places in a photo and what is known there.

    Attributes:
        pixel: (N, 2) float64 x, y; the centre of the first pixel is (0.5, 0.5).
        depth: (N,) float32 z-depth, metres.
        num_consistent: (N,) uint8, how many views agree.
    """

    pixel: np.ndarray
    depth: np.ndarray
    num_consistent: np.ndarray


def thinned(depth: np.ndarray, num_consistent: np.ndarray, step: int) -> Thinned:
    """Of each block of step x step pixels one depth, where it has one.

    Whoever takes a depth for what its block shows needs that of the block's centre. Of an even number of pixels none is
    there: the four around it are averaged where they are of one surface, whose inverse depth is linear in the image.
    Another pixel's depth would be half a pixel off to the same side in all blocks, which moves floors and ceilings.
    Where four are not of one surface, the one with most views stands for the block, at its own place.

    Args:
        depth: (H, W) float32 z-depth, metres, 0 = none.
        num_consistent: (H, W) uint8, how many views agree.
    """
    height, width = (side // step * step for side in depth.shape)
    beside = [(row, column) for row in ((step - 1) // 2, step // 2) for column in ((step - 1) // 2, step // 2)]
    z, views = (np.stack([of[i:height:step, j:width:step] for i, j in beside]) for of in (depth, num_consistent))
    one_surface = (z.min(axis=0) > 0) & (z.max(axis=0) < ONE_SURFACE * z.min(axis=0))
    best = np.where(z > 0, views.astype(np.int16), -1).argmax(axis=0)
    z_best, views_best = (np.take_along_axis(of, best[None], axis=0)[0] for of in (z, views))
    inverse = np.mean(1 / np.where(one_surface, z, 1), axis=0)
    at_best = np.array(beside)[best] + 0.5  # (h, w, 2) row, column
    inside = np.where(one_surface[..., None], step / 2, at_best)
    row, column = np.nonzero(z_best)
    place = (row, column)
    return Thinned(
        np.stack([column, row], axis=1) * step + inside[place][:, ::-1],
        np.where(one_surface, 1 / inverse, z_best)[place].astype(np.float32),
        np.where(one_surface, np.rint(views.mean(axis=0)), views_best)[place].astype(np.uint8),
    )
