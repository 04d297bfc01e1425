"""Compressed maps: 8 bytes a pixel for depth, normals and both confidences, instead of 24.

Rounding, at most: depth 0.0085 % of itself (0.4 mm at 5 m), normals 0.004 degrees, confidence 0.002 (0.004 near 0);
a test holds them to it. Half precision would round depth by 0.05 % and normals in 8 bits by 0.4 degrees, which tilts
a wall of 4 m by 3 cm.
"""

from __future__ import annotations

import hashlib
import math

import numpy as np

from room2dgs import _C
from room2dgs.captures.view_maps import ViewMaps, valid_depth

# Depth is a logarithm in 65,535 steps; code 0 = invalid. What is nearer or farther is clipped.
NEAREST_M, FARTHEST_M = 0.01, 655.36
_CODES = 65534
_LOG_STEP = math.log(FARTHEST_M / NEAREST_M) / _CODES
# Decoding is a look-up: the same bits everywhere, and no exponential a pixel.
_DEPTHS = np.concatenate([[0.0], NEAREST_M * np.exp(_LOG_STEP * np.arange(_CODES + 1))]).astype(np.float32)
_CONFIDENCES = (np.arange(256) / 255).astype(np.float32)

Packed = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def pack(maps: ViewMaps[np.ndarray]) -> Packed:
    """(depth (H, W) uint16, confidence (H, W) uint8, normal (2, H, W) int16, confidence); of size 0 for None.

    What is not finite is invalid. A confidence above 0 stays above 0.
    """
    return (
        _none(np.uint16) if maps.depth is None else pack_depth(maps.depth),
        _none(np.uint8) if maps.depth_confidence is None else _pack_confidence(maps.depth_confidence),
        _none(np.int16) if maps.normal is None else _pack_normal(maps.normal),
        _none(np.uint8) if maps.normal_confidence is None else _pack_confidence(maps.normal_confidence),
    )


def unpack(packed: Packed, source: str = "") -> ViewMaps[np.ndarray]:
    """What `pack` was given, rounded; normals lie in memory one axis after the other."""
    depth, depth_confidence, normal, normal_confidence = packed
    return ViewMaps(
        unpack_depth(depth) if depth.size else None,
        _CONFIDENCES.take(depth_confidence) if depth_confidence.size else None,
        _unpack_normal(normal) if normal.size else None,
        _CONFIDENCES.take(normal_confidence) if normal_confidence.size else None,
        source,
    )


def pack_depth(depth: np.ndarray) -> np.ndarray:
    """uint16 codes of depths in metres, of any shape; 0 = invalid."""
    valid = valid_depth(depth)
    known = np.where(valid, depth, np.float32(1)).clip(NEAREST_M, FARTHEST_M)
    return np.where(valid, np.round(np.log(known / NEAREST_M) / _LOG_STEP) + 1, 0).astype(np.uint16)


def unpack_depth(codes: np.ndarray) -> np.ndarray:
    """float32 metres."""
    return _DEPTHS.take(codes)


def digest(packed: Packed) -> str:
    """Hex digits that stand for the maps."""
    hasher = hashlib.sha256()
    for array in packed:
        hasher.update(f"{array.dtype} {array.shape}".encode())
        hasher.update(np.ascontiguousarray(array).data)
    return hasher.hexdigest()


def _none(dtype: type) -> np.ndarray:
    return np.zeros(0, dtype)


def _pack_confidence(confidence: np.ndarray) -> np.ndarray:
    codes = np.round(np.nan_to_num(confidence).clip(0, 1) * 255)
    return np.where(confidence > 0, np.maximum(codes, 1), 0).astype(np.uint8)


def _pack_normal(normal: np.ndarray) -> np.ndarray:
    """Octahedral coordinates (Meyer et al. 2010): the sphere folded onto a square. One axis after the other."""
    codes = np.empty((2, *normal.shape[:2]), np.int16)
    axes = np.ascontiguousarray(np.moveaxis(normal, -1, 0), np.float32)
    _C.pack_normals(axes.reshape(3, -1), codes.reshape(2, -1))
    return codes


def _unpack_normal(codes: np.ndarray) -> np.ndarray:
    axes = np.empty((3, *codes.shape[1:]), np.float32)
    _C.unpack_normals(np.ascontiguousarray(codes).reshape(2, -1), axes.reshape(3, -1))
    return np.moveaxis(axes, 0, -1)
