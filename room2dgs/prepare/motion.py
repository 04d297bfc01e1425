"""How far the picture moves from one frame of a video to the next."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

WIDTH = 320  # pixels at which corners are followed
CORNERS = 250
FEW = 12  # corners: a blank wall says nothing of the motion
MIN_FOLLOWED = 0.25
MAX_BACK_PX = 1.5
MOST_OF = 0.8  # of the corners move less: who walks around a thing keeps it in the middle of the picture
JUMP = 0.3  # of the width: corners were there and none is found again


class Motion:
    """Follows corners from each frame to the next."""

    def __init__(self) -> None:
        self._last: np.ndarray | None = None

    def step(self, grey: np.ndarray) -> float:
        """Motion of the picture since the last frame, as a share of its width; NaN: too few corners.

        Args:
            grey: (H, W) uint8.
        """
        height = max(16, round(WIDTH * grey.shape[0] / grey.shape[1]))
        small = cv2.resize(grey, (WIDTH, height), interpolation=cv2.INTER_AREA)
        last, self._last = self._last, small
        if last is None:
            return 0.0
        corners = cv2.goodFeaturesToTrack(last, CORNERS, 0.01, 6)
        if corners is None or len(corners) < FEW:
            return float("nan")
        there, found = _followed(last, small, corners)
        back, found_back = _followed(small, last, there)
        good = (found & found_back).ravel().astype(bool)
        good &= np.linalg.norm((back - corners).reshape(-1, 2), axis=1) < MAX_BACK_PX
        if good.mean() < MIN_FOLLOWED:
            return JUMP
        moved = np.linalg.norm((there - corners).reshape(-1, 2)[good], axis=1)
        return float(np.quantile(moved, MOST_OF)) / WIDTH


def _followed(one: np.ndarray, other: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where corners (N, 1, 2) of a picture are in another one, and (N, 1) uint8 whether they were found."""
    nowhere: Any = None  # no first guess, which the stubs do not know of
    there, found, _ = cv2.calcOpticalFlowPyrLK(one, other, corners, nowhere, winSize=(25, 25), maxLevel=4)
    return there, found


def filled(steps: np.ndarray) -> np.ndarray:
    """(N,) steps with NaN replaced by interpolation between those before and after."""
    known = np.isfinite(steps)
    if not known.any():
        return np.zeros(len(steps))
    place = np.arange(len(steps))
    return np.interp(place, place[known], steps[known])
