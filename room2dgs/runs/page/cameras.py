"""The photos of a page's room: where their cameras stand, small pictures, and the way that was walked."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.selection import evenly_spaced
from room2dgs.geometry.camera import Camera
from room2dgs.report.page import data_uri
from room2dgs.runs.page.views import small
from room2dgs.texts import shown

LONGEST = 480  # pixels of a photo
MAX_PATH = 1000  # places of the way
SHARE, LEAST_M, LARGEST_M = 0.6, 0.02, 0.2  # of the spacing of the cameras: how deep a camera is drawn


def camera_list(frames: Sequence[Frame], wanted: Collection[str], most: int) -> list[dict[str, Any]]:
    """Cameras for photos.js, in the capture's order.

    Args:
        wanted: names of photos that must be among them.
        most: photos besides.
    """
    ordered = sorted(frames, key=lambda frame: frame.index)
    names = {frame.name for frame in evenly_spaced(ordered, most)} | set(wanted)
    return [_camera(frame) for frame in ordered if frame.name in names]


def path_of(frames: Sequence[Frame]) -> list[list[float]]:
    """Where the cameras stood, one after the other; metres, scene's frame."""
    ordered = evenly_spaced(sorted(frames, key=lambda frame: frame.index), MAX_PATH)
    return [np.round(frame.camera.centre, 4).tolist() for frame in ordered]


def camera_size_m(cameras: Sequence[Camera]) -> float:
    """How deep a camera is drawn: by the distance between a camera and the nearest other, the median of all."""
    from scipy.spatial import cKDTree

    centres = np.array([camera.centre for camera in cameras])
    if len(centres) < 2:
        return LARGEST_M
    spacing = float(np.median(cKDTree(centres).query(centres, k=2)[0][:, 1]))
    return min(max(SHARE * spacing, LEAST_M), LARGEST_M)


def first_side(cameras: Sequence[Camera], middle: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(3,) unit, level: from where to look at first. Half a room is seen from the side of its cameras.

    Args:
        middle: (3,) of the room.
        up: (3,) unit.
    """
    across = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    side = np.mean([camera.centre for camera in cameras], axis=0) - middle
    side = side - (side @ up) * up + 1e-3 * across
    return side / np.linalg.norm(side)


def _camera(frame: Frame) -> dict[str, Any]:
    one = frame.camera
    return {
        "name": shown(frame.name),
        "at": np.round(one.centre, 5).tolist(),
        "turn": np.round(one.world_from_cam[:3, :3], 6).ravel().tolist(),
        "fx": round(float(one.K[0, 0]), 3),
        "fy": round(float(one.K[1, 1]), 3),
        "cx": round(float(one.K[0, 2]), 3),
        "cy": round(float(one.K[1, 2]), 3),
        "width": one.width,
        "height": one.height,
        "photo": data_uri(small(frame.color() / 255, LONGEST)),
    }
