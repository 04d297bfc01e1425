"""An independent reader of made captures in the ScanNet layout."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np


@dataclass(frozen=True)
class Capture:
    """A room read back from its files: K for centres at +0.5, poses world_from_cam, depths in metres."""

    path: Path
    K: np.ndarray
    poses: list[np.ndarray]
    colors: list[np.ndarray]
    depths: list[np.ndarray]

    def rays(self) -> np.ndarray:
        """(H, W, 3) directions through the pixel centres in the camera, z = 1."""
        height, width = self.depths[0].shape
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        return np.stack([(x - self.K[0, 2]) / self.K[0, 0], (y - self.K[1, 2]) / self.K[1, 1], np.ones_like(x)], -1)

    def points(self, index: int) -> np.ndarray:
        """(H, W, 3) world positions of a frame's pixels; meaningless where the depth is 0."""
        in_cam = self.rays() * self.depths[index][..., None]
        return in_cam @ self.poses[index][:3, :3].T + self.poses[index][:3, 3]


def read_capture(path: Path) -> Capture:
    """Reads a ScanNet folder without the project's own reader."""
    K = np.loadtxt(path / "intrinsic/intrinsic_color.txt")[:3, :3]
    K[:2, 2] += 0.5
    count = len(list((path / "pose").iterdir()))
    return Capture(
        path,
        K,
        [np.loadtxt(path / f"pose/{i}.txt") for i in range(count)],
        [cv2.imread(str(path / f"color/{i}.jpg")).astype(np.float64) for i in range(count)],
        [cv2.imread(str(path / f"depth/{i}.png"), cv2.IMREAD_UNCHANGED) / 1000.0 for i in range(count)],
    )
