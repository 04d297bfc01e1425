"""Where surfaces may end: at the edges of the photo.

Networks and normals run smoothly from a curtain across to the wall behind it. The photo shows where the curtain ends.
What has much texture loses its ties, too, but there stereo knows the depth.
"""

from __future__ import annotations

import numpy as np

from room2dgs.depth.completion.solve import share

EDGE = 8.0  # grey levels between neighbours of a small image at which a tie is half as stiff
LEAST = 0.02  # of a tie, that any edge leaves


def ties_across_edges(photo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is left of the ties between neighbours.

    Args:
        photo: (h, w, 3) 0..255.

    Returns:
        (h, w - 1) along x and (h - 1, w) along y, `LEAST`..1.
    """
    levels = photo.astype(np.float64)
    right, down = (np.sqrt((np.diff(levels, axis=axis) ** 2).mean(axis=-1)) for axis in (1, 0))
    return LEAST + (1 - LEAST) * share(right, EDGE), LEAST + (1 - LEAST) * share(down, EDGE)
