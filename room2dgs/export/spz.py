"""SPZ version 3 (Niantic's compressed splats): one gzip stream of attributes in fixed point, y up.

Format: https://github.com/nianticlabs/spz, its README and load-spz.cc.
"""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np
from torch import Tensor

from room2dgs.export.axes import turned
from room2dgs.export.local_files import write_local
from room2dgs.export.source import Source
from room2dgs.primitives.primitive import Splats, mapped
from room2dgs.primitives.registry import primitive_of

MAGIC, VERSION = 0x5053474E, 3
FRACTION_BITS = 12  # positions in steps of 0.24 mm
REACH_M = 2.0 ** (23 - FRACTION_BITS)
COLOR_SCALE = 0.15
SH_STEP = (8, 16)  # of 256, of degree 1 and of those above: what is left compresses better


def write_spz(source: Source, path: Path) -> list[Path]:
    """With y up."""
    return write_local(source, path, spz_bytes(turned(source.surfels, source.y_up)), source.y_up)


def spz_bytes(splats: Splats) -> bytes:
    """A whole file. Positions beyond 2 km end there.

    Args:
        splats: in a frame with y up (z towards the viewer).
    """
    primitive, splats = primitive_of(splats), mapped(splats, Tensor.double)
    degree = int(splats.sh.shape[1] ** 0.5) - 1
    sh = splats.sh.numpy()
    parts: list[bytes | np.ndarray] = [
        struct.pack("<3I4B", MAGIC, VERSION, len(sh), degree, FRACTION_BITS, 0, 0),
        _positions(splats.centers.numpy()),
        _byte(splats.opacities.numpy() * 255),
        _byte(sh[:, 0] * (COLOR_SCALE * 255) + 127.5),
        _byte((np.log(primitive.three_scales(splats)) + 10) * 16),
        _rotations(splats.rotations.numpy()),
        _harmonics(sh[:, 1:]),
    ]
    # no time in the header: equal surfels give equal bytes
    return gzip.compress(b"".join(part if isinstance(part, bytes) else part.tobytes() for part in parts), mtime=0)


def _positions(centers: np.ndarray) -> np.ndarray:
    """(N, 3, 3) uint8: 24 bits a coordinate, little endian."""
    fixed = np.round(centers.clip(-REACH_M, REACH_M) * 2**FRACTION_BITS).clip(-(2**23), 2**23 - 1).astype("<i4")
    return np.ascontiguousarray(fixed).view(np.uint8).reshape(*fixed.shape, 4)[..., :3]


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
