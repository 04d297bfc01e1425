"""Which photos a network that sees several at a time sees together, and their poses as it reads them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.config.card import CardViews
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose
from room2dgs.geometry.view_selection import MIN_SHARED, shared_view

LEAST_UNIT_M = 0.1  # of `CardViews.unit` median_distance
# how much better a photo without a map has to go with the others than one that has one, as a factor
UNANSWERED = 1.5


class Window(NamedTuple):
    """Photos that go in together.

    Attributes:
        views: indices; the first photo is the reference.
        answers: those of them whose map is taken from this window.
    """

    views: tuple[int, ...]
    answers: tuple[int, ...]


def windows(cameras: Sequence[Camera], count: int, answers: str) -> list[Window]:
    """Windows such that each photo has its map from one of them.

    A window's first photo has beside it the photos that triangulate best what it sees (`shared_view`), then those that
    see the same without a baseline, then the nearest. With `answers` "all" the others get their maps too, where they go
    well with the first; then photos that have none yet are preferred, and fewer windows are enough.

    Args:
        cameras: of at least `count` photos.
        count: photos of a window.
        answers: as `CardViews.answers`.
    """
    triangulated, shared = shared_view(cameras), shared_view(cameras, by_angle=False)
    centres = np.stack([camera.centre for camera in cameras])
    distance = np.linalg.norm(centres[:, None] - centres, axis=-1)
    waiting = np.ones(len(cameras), dtype=bool)
    found: list[Window] = []
    while waiting.any():
        # what sees most of what still has no map goes first
        first = int(np.argmax(np.where(waiting, (triangulated * waiting).sum(axis=1), -1.0)))
        score = triangulated[first] * (np.where(waiting, UNANSWERED, 1.0) if answers == "all" else 1.0)
        order = np.lexsort((distance[first], -shared[first], -score))
        others = [int(index) for index in order if index != first][: count - 1]
        good = [index for index in others if waiting[index] and triangulated[first, index] >= MIN_SHARED]
        answered = (first, *(good if answers == "all" else ()))
        waiting[list(answered)] = False
        found.append(Window((first, *others), answered))
    return found


def window_poses(cameras: Sequence[Camera], views: CardViews) -> np.ndarray:
    """(V, 4, 4) float64 poses of a window's cameras, as its network reads them.

    Args:
        cameras: the first is the reference.
        views: what the card says of poses.
    """
    cam_from_world = np.stack([camera.cam_from_world for camera in cameras])
    if views.origin == "first":
        cam_from_world = cam_from_world @ cameras[0].world_from_cam
    if views.unit == "median_distance":
        # Depth Anything 3's: torch.median is the lower of two middle ones
        distances = np.linalg.norm(np.stack([camera.centre for camera in cameras]) - cameras[0].centre, axis=1)
        cam_from_world[:, :3, 3] /= max(float(np.sort(distances)[(len(cameras) - 1) // 2]), LEAST_UNIT_M)
    if views.pose == "world_from_cam":
        return np.stack([inverse_pose(pose) for pose in cam_from_world])
    return cam_from_world
