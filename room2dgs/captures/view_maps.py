"""Depth and normals of a view with their confidences, in one container for all sources."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

import numpy as np

Array = TypeVar("Array")


class ViewMaps(NamedTuple, Generic[Array]):
    """Depth, normals and how far each is to be trusted; numpy arrays, or torch tensors where training reads them.

    A pixel is valid where its value is not 0. Networks, files, a sensor or stereo fill it in alike.

    Attributes:
        depth: (H, W) float32 z-depth, metres; 0 = invalid; None: no depth.
        depth_confidence: (H, W) float32 in 0..1, 0 where the depth is invalid; None: 1 wherever it is valid.
        normal: (H, W, 3) float32 unit, world frame, facing the camera; 0 = invalid; None: no normals.
        normal_confidence: (H, W) likewise.
        source: what made the maps, such as "room_prior" or "files+onnx".
    """

    depth: Array | None = None
    depth_confidence: Array | None = None
    normal: Array | None = None
    normal_confidence: Array | None = None
    source: str = ""


def valid_depth(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool of a depth map; what is not finite is not valid either."""
    return np.isfinite(depth) & (depth > 0)


def valid_normal(normal: np.ndarray) -> np.ndarray:
    """(H, W) bool of a normal map; likewise."""
    x, y, z = np.moveaxis(normal, -1, 0)  # axis by axis: numpy is slow over an innermost axis of three
    return np.isfinite(x) & np.isfinite(y) & np.isfinite(z) & ((x != 0) | (y != 0) | (z != 0))
