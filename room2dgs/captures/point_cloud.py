"""Sparse points and their tracks: which photo observes which point at which pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tracks:
    """Observations of points in photos, O of them; a photo observes a point once at most.

    Attributes:
        frames: names of the photos.
        frame: (O,) int32, index into `frames`.
        point: (O,) int32, index of the point.
        pixel: (O, 2) float32, x and y in the photo at its working size; pixel (i, j) has its centre at
            (i + 0.5, j + 0.5).
    """

    frames: tuple[str, ...]
    frame: np.ndarray
    point: np.ndarray
    pixel: np.ndarray

    def __len__(self) -> int:
        return len(self.point)

    def of_frame(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """What one photo saw: (N,) indices of points and (N, 2) their pixels; nothing for a photo without tracks."""
        index = self.frames.index(name) if name in self.frames else -1
        rows = np.flatnonzero(self.frame == index)
        return self.point[rows], self.pixel[rows]


@dataclass(frozen=True)
class PointCloud:
    """Sparse points in the world frame.

    Attributes:
        xyz: (M, 3) float64, metres.
        rgb: (M, 3) uint8.
        tracks: what photos saw; None where nobody knows, as for points from a file.
        weight: (M,) float32 in 0..1, the trust in each point; None: 1.
        left_out: number of points of a capture that are none, and are not among these.
    """

    xyz: np.ndarray
    rgb: np.ndarray
    tracks: Tracks | None = None
    weight: np.ndarray | None = None
    left_out: int = 0

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def known_tracks(self) -> Tracks:
        """`tracks`, of a cloud that has some."""
        assert self.tracks is not None, "the points have no tracks"
        return self.tracks

    @property
    def track_length(self) -> np.ndarray:
        """(M,) int64 number of photos that saw each point; 0 where unknown."""
        if self.tracks is None:
            return np.zeros(len(self), dtype=np.int64)
        return np.bincount(self.tracks.point, minlength=len(self))

    def chosen(self, which: np.ndarray) -> PointCloud:
        """Some of the points, with their tracks.

        Args:
            which: (M,) bool.
        """
        tracks = self.tracks
        if tracks is not None:
            number = np.cumsum(which) - 1
            kept = which[tracks.point]
            point = number[tracks.point[kept]].astype(np.int32)
            tracks = Tracks(tracks.frames, tracks.frame[kept], point, tracks.pixel[kept])
        weight = None if self.weight is None else self.weight[which]
        return PointCloud(self.xyz[which], self.rgb[which], tracks, weight)

    def weight_of(self, index: np.ndarray) -> np.ndarray:
        """(N,) float32 trust in some of the points.

        Args:
            index: (N,) int64.
        """
        return np.ones(len(index), np.float32) if self.weight is None else self.weight[index]
