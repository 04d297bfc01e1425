"""Frames of a video to use: the sharpest of each piece of the camera's path."""

from __future__ import annotations

import numpy as np

LEAST = 24  # pieces: little motion in the picture may be a long way around something
MIDDLE = 0.7  # of a piece: so that neighbours are neither next to each other nor two pieces apart


def chosen_frames(sharpness: np.ndarray, steps: np.ndarray, spacing: float, most: int) -> np.ndarray:
    """Frames that keep a distance from each other, and are sharp.

    The path of the picture is cut into equal pieces of about `spacing`, longer if there were more than `most`; each
    piece gives the sharpest frame of its middle. A camera that stands still gives one frame.

    Args:
        sharpness: (N,).
        steps: (N,) what the picture moved since the frame before, finite.
        spacing: in the same unit.

    Returns:
        (M,) int64 rising, M <= most.
    """
    way = np.cumsum(steps)
    pieces = int(min(max(np.ceil(way[-1] / spacing), LEAST), most))
    place = way / max(way[-1], 1e-12) * pieces
    piece = np.minimum(place.astype(np.int64), pieces - 1)
    off = np.abs(place - piece - 0.5)
    # the middle of a piece first, then what is sharpest
    order = np.lexsort((-sharpness, off > MIDDLE / 2, piece))
    first = np.unique(piece[order], return_index=True)[1]
    return np.sort(order[first])
