"""The sparse points that a photo observes, with pixel and depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import NEAR_M, Camera
from room2dgs.geometry.cells import cells_of

CELLS = 24  # across the image, in each of which points hide one another
ENOUGH_TRACKED = 400  # points of a photo; a guess adds to fewer
HIDDEN = 1.25  # a point this many times as far as its cell's nearest is hidden


@dataclass(frozen=True)
class SeenPoints:
    """N points as one photo sees them.

    Attributes:
        index: (N,) int64, which points of the cloud.
        pixel: (N, 2) float64, x and y inside the image.
        depth: (N,) float64 z-depth, metres, > 0.
    """

    index: np.ndarray
    pixel: np.ndarray
    depth: np.ndarray

    @property
    def column_row(self) -> tuple[np.ndarray, np.ndarray]:
        """(N,) int64 columns and rows of the pixels that the points fall into."""
        column, row = np.floor(self.pixel).astype(np.int64).T
        return column, row


def seen_points(points: PointCloud, frame: Frame) -> SeenPoints:
    """What the tracks say, and without tracks a guess (`probably_seen`)."""
    if points.tracks is None:
        return probably_seen(points.xyz, frame.camera)
    index, pixel = points.tracks.of_frame(frame.name)
    depth = frame.camera.to_camera(points.xyz[index])[:, 2]
    usable = frame.camera.inside(pixel) & (depth > NEAR_M)
    return SeenPoints(index[usable].astype(np.int64), pixel[usable].astype(np.float64), depth[usable])


def likely_points(points: PointCloud, frame: Frame) -> tuple[SeenPoints, np.ndarray]:
    """Points that a photo has seen and, if these are few, those that it probably sees too.

    A track has a few photos of the many that see its point. Where a photo has hardly any, a robust fit is better off
    with guesses; where it has many, hidden points among the guesses do harm (docs/studies/poses.md).

    Returns:
        The points, and (N,) bool: which of them the photo is known to have seen.
    """
    if points.tracks is None:
        guess = probably_seen(points.xyz, frame.camera)
        return guess, np.ones(len(guess.index), dtype=bool)
    sure = seen_points(points, frame)
    if len(sure.index) >= ENOUGH_TRACKED:
        return sure, np.ones(len(sure.index), dtype=bool)
    guess = probably_seen(points.xyz, frame.camera)
    more = ~np.isin(guess.index, sure.index)
    both = SeenPoints(
        np.concatenate([sure.index, guess.index[more]]),
        np.concatenate([sure.pixel, guess.pixel[more]]),
        np.concatenate([sure.depth, guess.depth[more]]),
    )
    return both, np.arange(len(sure.index) + int(more.sum())) < len(sure.index)


def probably_seen(xyz: np.ndarray, camera: Camera) -> SeenPoints:
    """A guess for points without tracks: those that project into the image and are not plainly behind another one.

    Sparse points know no surfaces between them, so this thins the hidden ones out and no more.

    Args:
        xyz: (M, 3) metres, world frame.
    """
    pixel, depth = camera.project(xyz)
    index = np.flatnonzero(camera.inside(pixel) & (depth > NEAR_M))
    pixel, depth = pixel[index], depth[index]
    cell_px = max(4, camera.width // CELLS)
    cells, cell = cells_of(pixel, cell_px)
    nearest = np.full(len(cells), np.inf)
    np.minimum.at(nearest, cell, depth)
    shown = depth <= HIDDEN * nearest[cell]
    return SeenPoints(index[shown], pixel[shown], depth[shown])
