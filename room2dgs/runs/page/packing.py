"""Arrays as text inside a page: zlib, then base64, each beginning at a multiple of four bytes."""

from __future__ import annotations

import base64
import zlib

import numpy as np

ALIGNED = 4  # bytes; a browser's typed arrays want it
STEPS = 65535  # of a coordinate


def packed(*arrays: np.ndarray) -> str:
    """The arrays' bytes, little endian, one after the other."""
    parts = []
    for array in arrays:
        raw = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes()
        parts.append(raw + bytes(-len(raw) % ALIGNED))
    return base64.b64encode(zlib.compress(b"".join(parts), 9)).decode("ascii")


def stepped(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Points (N, 3) in metres as (N, 3) uint16 steps from a corner (3,), and the step in metres."""
    low = points.min(axis=0) if len(points) else np.zeros(3)
    step = max(float(np.ptp(points, axis=0).max()) / STEPS if len(points) else 0.0, 1e-9)
    return np.round((points - low) / step).astype(np.uint16), low, step
