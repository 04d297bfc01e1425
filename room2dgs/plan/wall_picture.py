"""What photos show of a wall, looked at straight on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import Camera
from room2dgs.runs.trust import Trust

NEAREST_M = 0.2  # of a camera to what it shows, and before the wall
HIDDEN_M, HIDDEN_SHARE = 0.05, 0.03  # nearer than a point by that much and that share: what hides it


class Seen(NamedTuple):
    """Of N points: (N, 3) colours 0..1, and (N,) bool which are shown at all."""

    color: np.ndarray
    known: np.ndarray


Look = Callable[[np.ndarray, np.ndarray], Seen]
"""The colours of (N, 3) points of a plane with a (3,) unit normal to the side that is seen."""


def look_of(frames: Sequence[Frame], maps: Mapping[str, Trust], level_from_world: np.ndarray) -> Look:
    """The photos of all views that small maps were kept of, blended: near ones and straight ones count most.

    Args:
        level_from_world: (3, 3) rotation into the frame in which is asked.
    """
    views = [(frame, maps[frame.name].depth) for frame in frames if frame.name in maps]

    def look(points: np.ndarray, normal: np.ndarray) -> Seen:
        world, towards = points @ level_from_world, normal @ level_from_world
        total, color = np.zeros(len(points)), np.zeros((len(points), 3))
        for frame, depth in views:
            if depth is None:
                continue
            shown, weight, pixel = _shown(frame.camera, depth, world, towards)
            if len(shown):
                total[shown] += weight
                color[shown] += weight[:, None] * _sampled(frame.levelled_color(), pixel)
        return Seen(color / np.maximum(total, 1e-12)[:, None], total > 0)

    return look


def _shown(
    camera: Camera, depth: np.ndarray, world: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which points a view shows, that nothing in its small map of depth hides: numbers, weights, (M, 2) pixels."""
    pixel, away = camera.project(world)
    ray = camera.centre - world
    before = ray @ normal
    inside = np.nonzero((away > NEAREST_M) & (before > NEAREST_M) & camera.inside(pixel))[0]
    height, width = depth.shape
    cell = np.floor(pixel[inside] * (width / camera.width, height / camera.height)).astype(int)
    ends = depth[np.minimum(cell[:, 1], height - 1), np.minimum(cell[:, 0], width - 1)].astype(np.float64)
    free = (ends <= 0) | (ends > (1 - HIDDEN_SHARE) * away[inside] - HIDDEN_M)
    shown = inside[free]
    return shown, before[shown] / np.linalg.norm(ray[shown], axis=1) / away[shown] ** 2, pixel[shown]


def _sampled(photo: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    x, y = (pixel - 0.5).astype(np.float32).T
    found = cv2.remap(photo, x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found[0].astype(np.float64) / 255
