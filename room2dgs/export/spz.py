"""SPZ version 3 (Niantic's compressed splats): one gzip stream of attributes in fixed point, y up.

Format: https://github.com/nianticlabs/spz, its README and load-spz.cc.
"""

from __future__ import annotations

import gzip
import struct

import numpy as np

from room2dgs.export.gaussian_ply import FLAT
from room2dgs.splat.types import Surfels

MAGIC, VERSION = 0x5053474E, 3
FRACTION_BITS = 12  # positions in steps of 0.24 mm
REACH_M = 2.0 ** (23 - FRACTION_BITS)
COLOR_SCALE = 0.15
SH_STEP = (8, 16)  # of 256, of degree 1 and of those above: what is left compresses better


def spz_bytes(surfels: Surfels) -> bytes:
    """A whole file. Positions beyond 2 km end there.

    Args:
        surfels: in a frame with y up (z towards the viewer).
    """
    degree = int(surfels.sh.shape[1] ** 0.5) - 1
    sh = surfels.sh.double().numpy()
    parts = [
        struct.pack("<3I4B", MAGIC, VERSION, len(sh), degree, FRACTION_BITS, 0, 0),
        _positions(surfels.centers.double().numpy()),
        _byte(surfels.opacities.double().numpy() * 255),
        _byte(sh[:, 0] * (COLOR_SCALE * 255) + 127.5),
        _scales(surfels.scales.double().numpy()),
        _rotations(surfels.rotations.double().numpy()),
        _harmonics(sh[:, 1:]),
    ]
    # no time in the header: equal surfels give equal bytes
    return gzip.compress(b"".join(part if isinstance(part, bytes) else part.tobytes() for part in parts), mtime=0)


def _positions(centers: np.ndarray) -> np.ndarray:
    """(N, 3, 3) uint8: 24 bits a coordinate, little endian."""
    fixed = np.round(centers.clip(-REACH_M, REACH_M) * 2**FRACTION_BITS).clip(-(2**23), 2**23 - 1).astype("<i4")
    return np.ascontiguousarray(fixed).view(np.uint8).reshape(*fixed.shape, 4)[..., :3]


def _scales(scales: np.ndarray) -> np.ndarray:
    logs = np.log(np.column_stack([scales, np.full(len(scales), FLAT)]))
    return _byte((logs + 10) * 16)


def _rotations(wxyz: np.ndarray) -> np.ndarray:
    """(N,) uint32: which of x, y, z, w is largest in the top bits, then a sign and 9 bits for each other, in order."""
    q = wxyz[:, (1, 2, 3, 0)]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    largest = np.abs(q).argmax(axis=1)
    rows = np.arange(len(q))
    q = q * np.where(q[rows, largest] < 0, -1.0, 1.0)[:, None]
    packed = largest.astype(np.uint32)
    size = np.round(np.abs(q) * (511 * np.sqrt(2))).clip(0, 511).astype(np.uint32) | (q < 0).astype(np.uint32) << 9
    for component in range(4):
        packed = np.where(component == largest, packed, packed << 10 | size[:, component])
    return packed.astype("<u4")


def _harmonics(rest: np.ndarray) -> np.ndarray:
    """(N, K - 1, 3) uint8, channel fastest, rounded to steps."""
    step = np.where(np.arange(rest.shape[1]) < 3, *SH_STEP)[None, :, None]
    value = np.round(rest * 128) + 128
    return ((value + step // 2) // step * step).clip(0, 255).astype(np.uint8)


def _byte(values: np.ndarray) -> np.ndarray:
    return np.round(values).clip(0, 255).astype(np.uint8)
