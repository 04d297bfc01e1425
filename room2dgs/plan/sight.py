"""What views see, ray by ray: from the camera to where the depth of a pixel ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.uncertainty import completed_sigma
from room2dgs.runs.trust import Trust

STEP = 2  # every so many columns and rows of the small maps
LEAST_CONFIDENCE = 0.15  # of a depth that says anything


class Rays(NamedTuple):
    """R of them, in any one frame.

    Attributes:
        origin, end: (R, 3) metres.
        sigma_m: (R,) expected error of the end, along the ray.
        view: (R,) number of the view.
    """

    origin: np.ndarray
    end: np.ndarray
    sigma_m: np.ndarray
    view: np.ndarray

    def turned(self, turn: np.ndarray) -> Rays:
        """In another frame; turn (3, 3) is b_from_a."""
        return self._replace(origin=self.origin @ turn.T, end=self.end @ turn.T)


def rays_of(frames: Sequence[Frame], maps: Mapping[str, Trust]) -> Rays:
    """Of all views that small maps were kept of; scene's frame."""
    parts = []
    for number, frame in enumerate(frames):
        trust = maps.get(frame.name)
        if trust is not None and trust.depth is not None:
            parts.append(_of_view(number, frame, trust, trust.depth.astype(np.float64)))
    if not parts:
        none = np.zeros(0)
        return Rays(np.zeros((0, 3)), np.zeros((0, 3)), none, none.astype(int))
    return Rays(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _of_view(number: int, frame: Frame, trust: Trust, depth: np.ndarray) -> Rays:
    height, width = depth.shape
    camera = frame.camera.resized(width, height)
    sure = trust.confidence / 255
    rows, columns = np.mgrid[STEP // 2 : height : STEP, STEP // 2 : width : STEP]
    keep = (depth[rows, columns] > 0) & (sure[rows, columns] >= LEAST_CONFIDENCE)
    rows, columns = rows[keep], columns[keep]
    z = depth[rows, columns]
    end = camera.unproject(np.column_stack([columns + 0.5, rows + 0.5]), z)
    relative = completed_sigma(sure[rows, columns].astype(np.float32)).astype(np.float64)
    origin = np.tile(camera.centre, (len(z), 1))
    away = np.linalg.norm(end - origin, axis=1)
    return Rays(origin, end, relative * away, np.full(len(z), number))
