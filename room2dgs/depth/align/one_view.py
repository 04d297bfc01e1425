"""One view's depth prior: its values at points of known depth, and the fit applied to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import SeenPoints
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.align.scale_shift import Fit, aligned_depth

MAX_DEPTH_M = 100.0
# Maps of depth itself are off by a factor rather than by a shift: a free shift would follow their smooth errors.
METRIC_SHIFT_M = 0.1


class RawMap(NamedTuple):
    """A depth prior as it is read: (H, W) float32 values and (H, W) bool where they are valid."""

    values: np.ndarray
    valid: np.ndarray


RawMaps = Mapping[str, RawMap]


def pairs_at_points(raw: RawMap, seen: SeenPoints, settings: DepthPriorConfig) -> tuple[np.ndarray, np.ndarray]:
    """The map's values and the points' depths (or disparities) where the view sees points; (N,) each."""
    column, row = seen.column_row
    known = raw.valid[row, column]
    x, z = raw.values[row[known], column[known]].astype(np.float64), seen.depth[known]
    return x, 1.0 / z if is_disparity(settings) else z


def add_aligned(frame: Frame, raw: RawMaps, fit: Fit, settings: DepthPriorConfig, depths: LazyMaps[np.ndarray]) -> None:
    """Apply a view's fit and add the result to `depths`."""
    depths.add(frame.name, lambda: aligned_depth(*raw[frame.name], fit, is_disparity(settings), MAX_DEPTH_M))


def is_disparity(settings: DepthPriorConfig) -> bool:
    """Whether the maps hold 1 / depth."""
    return settings.meaning == "relative_inverse_depth"


def shift_sigma(settings: DepthPriorConfig) -> float | None:
    """How far from 0 a fit's shift is expected, metres; None: anywhere."""
    return METRIC_SHIFT_M if settings.meaning in ("metric_depth", "scaled_depth") else None
