"""Blocks between those that views have seen: a gap in a surface needs voxels to be closed in."""

from __future__ import annotations

import numpy as np

from room2dgs.mesh.voxel_table import AROUND


def closed(keys: np.ndarray, steps: int) -> np.ndarray:
    """(M,) int64 keys of the blocks and of those in gaps between them, rising: their morphological closing.

    Args:
        keys: (N,) int64, rising, none twice.
        steps: half of the widest gap that is closed, in blocks.
    """
    grown = keys
    for _ in range(steps):
        grown = np.unique(grown[:, None] + AROUND)
    for _ in range(steps):
        inner = np.isin(grown[:, None] + AROUND, grown).all(axis=1)
        grown = grown[inner]
    return np.union1d(grown, keys)
