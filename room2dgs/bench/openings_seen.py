"""Of which true openings the photos show the rim."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.bench.plan_truth import PlanTruth, TrueOpening
from room2dgs.captures.scene import Frame

STEP_M = 0.05  # along a rim
HIDDEN_M = 0.08  # before the rim: what hides it, and is no frame
OFF_FLOOR_M = 0.05  # where a rim begins that stands on the floor
LEAST_PHOTOS = 2  # that show a place of it
LEAST_SHARE = 0.5  # of a side, to be seen
BEFORE_WALL_M = 0.1  # from where a wall's own side is seen


def sides_seen(truth: PlanTruth, frames: Sequence[Frame]) -> list[float]:
    """The share of each opening's sides that photos show, the floor's aside; 1 where no true depth is at hand.

    Args:
        frames: of the capture, with its true depth; the world is that of the truth.
    """
    depths = [(frame, depth) for frame in frames if (depth := frame.depth()) is not None]
    if not depths:
        return [1.0] * len(truth.openings)

    def seen(one: TrueOpening, side: np.ndarray) -> bool:
        places = _places(one, side)
        photos = sum(_in_photo(frame, depth, places, one).astype(int) for frame, depth in depths)
        return bool(np.mean(photos >= LEAST_PHOTOS) >= LEAST_SHARE)

    return [float(np.mean([seen(one, side) for side in _rim(one)])) for one in truth.openings]


def _rim(one: TrueOpening) -> list[np.ndarray]:
    """(2, 2) ends of each side, along the wall and above the floor."""
    low = max(one.low_m, OFF_FLOOR_M)
    (a, b), top = (one.start_m, one.end_m), one.high_m
    sides = [[(a, low), (a, top)], [(b, low), (b, top)], [(a, top), (b, top)]]
    if one.low_m > 0:
        sides.append([(a, low), (b, low)])
    return [np.array(side) for side in sides]


def _places(one: TrueOpening, side: np.ndarray) -> np.ndarray:
    """(N, 3) points of a side, in the world."""
    count = max(2, int(np.ceil(np.linalg.norm(side[1] - side[0]) / STEP_M)))
    along, up = (side[0] + np.linspace(0, 1, count)[:, None] * (side[1] - side[0])).T
    return np.column_stack([one.wall.start + along[:, None] * one.wall.along, up])


def _in_photo(frame: Frame, depth: np.ndarray, places: np.ndarray, one: TrueOpening) -> np.ndarray:
    """(N,) bool: whether a photo shows each place from the side of the wall's room."""
    before = (frame.camera.centre[:2] - places[:, :2]) @ one.wall.normal > BEFORE_WALL_M
    shown = np.zeros(len(places), bool)
    index, column, row, away = frame.camera.pixels_of(places)
    shown[index] = depth[row, column] > away - HIDDEN_M
    return shown & before
