"""What views measured: the input of the search for mirrors, and all of it as points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from room2dgs.geometry.camera import Camera

MEASURED = 3  # consistent views of stereo's depth, at least, that make it a measurement


@dataclass(frozen=True)
class SmallView:
    """One view's small maps.

    Attributes:
        camera: of the maps' size.
        depth: (h, w) float64 z-depth, metres, 0 = none.
        num_consistent: (h, w) how many consistent views it counts as.
        color: (h, w, 3) float64 CIE L*a*b* as OpenCV has it for bytes.
    """

    camera: Camera
    depth: np.ndarray
    num_consistent: np.ndarray
    color: np.ndarray


class Sights(NamedTuple):
    """Pixels with a depth, N of them.

    Attributes:
        point, centre: (N, 3) what is seen and the camera that sees it, metres.
        distance: (N,) between them.
        view: (N,) number of the view.
        color: (N, 3).
        measured: (N,) bool.
    """

    point: np.ndarray
    centre: np.ndarray
    distance: np.ndarray
    view: np.ndarray
    color: np.ndarray
    measured: np.ndarray


def sights_of(views: Sequence[SmallView]) -> Sights:
    """Of all pixels of all views."""
    parts = []
    for number, view in enumerate(views):
        known = view.depth > 0
        point = view.camera.centre + view.camera.world_rays()[known] * view.depth[known][:, None]
        centre = np.broadcast_to(view.camera.centre, point.shape)
        measured = view.num_consistent[known] >= MEASURED
        distance = np.linalg.norm(point - centre, axis=1)
        parts.append(Sights(point, centre, distance, np.full(len(point), number), view.color[known], measured))
    return Sights(*(np.concatenate(part) for part in zip(*parts, strict=True)))
