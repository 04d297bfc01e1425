"""The photos that see points of a surface best, and the colour that they give."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs import _C
from room2dgs.captures.scene import Frame
from room2dgs.mesh.coloring.drawn import Surface

DRAWN_PX = 400  # width of the depth maps that tell what is hidden
SOFT_SHARE = 0.01  # of a photo's width, that its blurred copy averages

Progress = Callable[[int, int], None]  # photos done, of how many


class Points(NamedTuple):
    """Places on a surface that want a colour.

    Attributes:
        places, normals: (N, 3) float32, scene's frame; unit normals that face the cameras.
        spacing: (N,) float32, metres between a place and its neighbours; 0: as fine as the photo.
    """

    places: np.ndarray
    normals: np.ndarray
    spacing: np.ndarray


class Levels(NamedTuple):
    """How photos differ.

    Attributes:
        gain: (V, 3) float32, how much brighter each photo is than the others, of each colour.
        sharpness: (V,) up to 1, the local contrast of each beside that of the others.
    """

    gain: np.ndarray
    sharpness: np.ndarray

    @classmethod
    def alike(cls, count: int) -> Levels:
        """Photos that do not differ."""
        return cls(np.ones((count, 3), np.float32), np.ones(count))


class Views:
    """The best views of points, from one photo after the other."""

    def __init__(self, points: Points) -> None:
        count, best = len(points.places), 5
        self.points = points
        self.quality = np.zeros((count, best), np.float32)
        self.sharp = np.zeros((count, best, 3), np.uint8)
        self.low = np.zeros((count, best, 3), np.uint8)

    def look(
        self,
        frame: Frame,
        depth: np.ndarray,
        photo: np.ndarray,
        soft: np.ndarray,
        gain: np.ndarray,
        sharpness: float = 1.0,
    ) -> None:
        """Take a photo in.

        Args:
            frame: its camera is of the photo's size.
            depth: (h, w) float32 of the surface that hides what is behind it, of any size.
            photo: (H, W, 3) uint8.
            soft: (h, w, 3) uint8, the photo blurred, of any size.
            gain, sharpness: of `Levels`.
        """
        camera, usable = frame.camera, frame.mask()
        mask = None if usable is None else np.ascontiguousarray(usable, np.uint8)
        _C.look_up(
            *(self.points.places, self.points.normals, self.points.spacing),
            *(depth, np.ascontiguousarray(photo), np.ascontiguousarray(soft)),
            mask,
            *(camera.K[0, 0], camera.K[1, 1], camera.K[0, 2], camera.K[1, 2]),
            *(np.ascontiguousarray(camera.cam_from_world[:3]), np.ascontiguousarray(gain, np.float32)),
            *(float(sharpness), soft_px(camera.width)),
            *(self.quality, self.sharp, self.low),
        )

    def blended(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) float32 colours 0..255, and (N,) bool where some photo sees the point."""
        color, best = np.empty((len(self.quality), 3), np.float32), np.empty(len(self.quality), np.float32)
        _C.blend_views(self.quality, self.sharp, self.low, color, best)
        return color, best > 0


def best_colors(
    points: Points, surface: Surface, frames: Sequence[Frame], levels: Levels, progress: Progress | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Colours from the photos that see each point squarely, near, sharp and well away from their rims.

    What is large is a mean of the best few, levelled in exposure and without those that show something else; its fine
    detail is the best one's, which a mean would blur.

    Args:
        surface: hides what is behind it.
        frames: with cameras of the size at which photos are looked at.

    Returns:
        (N, 3) float32 0..255, and (N,) bool: seen by a photo. The same bits on any number of threads.
    """
    views = Views(points)
    for number, frame in enumerate(frames):
        photo = frame.color()
        depth = surface.seen_by(frame.camera.resized_to_width(min(DRAWN_PX, frame.camera.width))).depth
        views.look(frame, depth, photo, softened(photo), levels.gain[number], float(levels.sharpness[number]))
        if progress is not None:
            progress(number + 1, len(frames))
    return views.blended()


def softened(photo: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8: a photo averaged over about `soft_px` pixels."""
    height, width = photo.shape[:2]
    less = 2 / soft_px(width)
    size = max(1, round(width * less)), max(1, round(height * less))
    small = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small, (0, 0), 1.0, borderType=cv2.BORDER_REPLICATE)


def soft_px(width: int) -> float:
    """Pixels of a photo that its blurred copy averages."""
    return max(2.0, SOFT_SHARE * width)
