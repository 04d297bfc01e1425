"""The up axis and the walls' directions from vanishing points of straight edges in photos."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.up_axis import up_axis

SHORTEST = 0.05  # of the photo's width
WIDTH = 640
NARROWING_DEG = (12.0, 5.0, 2.5)
LEVEL_PRIOR = 0.002  # how little a camera may turn until its mean direction counts as level: about ten degrees
LEAST_LINES = 30
LEAST_SHARE = 0.35  # of edges within the first of these angles from upright lie within the last; by chance 0.2 would
LEVEL_DEG = 20.0  # edges that lean less than this from the horizontal tell where walls face
WINDOW_DEG = 2.0
BINS = 180  # of a right angle
# Edges in two perpendicular directions, over what the same number in random directions would give.
MIN_PEAK = 5.0


class RoomFrame(NamedTuple):
    """The room's axes.

    Attributes:
        room_from_world: (3, 3) rotation; z up, and x, y along the walls if `walls`.
        vertical_edges: number of edges that up was measured from; 0: it is from the cameras' x axes.
        walls: whether many edges have one of two perpendicular directions.
    """

    room_from_world: np.ndarray
    vertical_edges: int
    walls: bool


def room_frame(cameras: Sequence[Camera], pictures: Iterable[np.ndarray]) -> RoomFrame:
    """Up from the cameras' x axes, refined by vertical edges; the walls' directions from horizontal ones.

    An edge and the camera span a plane; edges of one direction have planes that all contain it.

    Args:
        cameras: of undistorted photos.
        pictures: (H, W, 3) uint8 RGB each, of the camera's size.
    """
    return axes_of_edges(*edge_planes(cameras, pictures), cameras)


def axes_of_edges(normals: np.ndarray, weights: np.ndarray, cameras: Sequence[Camera]) -> RoomFrame:
    """As `room_frame`, from what `edge_planes` gives."""
    from_cameras = up = up_axis(cameras, np.zeros((0, 3)), prior=LEVEL_PRIOR)
    vertical = 0
    for angle in NARROWING_DEG:
        near = np.abs(normals @ up) < np.sin(np.radians(angle))
        if near.sum() < LEAST_LINES:
            break
        chosen = normals[near] * weights[near, None] ** 0.5
        found = np.linalg.eigh(chosen.T @ chosen)[1][:, 0]
        up, vertical = found * np.sign(found @ up), int(near.sum())
    if not _edges_cluster(normals, weights, up):
        up, vertical = from_cameras, 0
    level = np.abs(normals @ up) > np.sin(np.radians(2 * NARROWING_DEG[-1]))
    heading, walls = _heading(normals[level], weights[level], up)
    across = np.cross(up, heading)
    return RoomFrame(np.stack([heading, across, up]), vertical, walls)


def _edges_cluster(normals: np.ndarray, weights: np.ndarray, up: np.ndarray) -> bool:
    """Whether edges cluster about vertical more than those of a random texture would."""
    sine = np.abs(normals @ up)
    around, close = (weights[sine < np.sin(np.radians(angle))].sum() for angle in (NARROWING_DEG[0], NARROWING_DEG[-1]))
    return bool(close > LEAST_SHARE * around)


def edge_planes(cameras: Sequence[Camera], pictures: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) unit normals, world frame, of the planes through straight edges, and (N,) their lengths in the photo."""
    normals, weights = [np.zeros((0, 3))], [np.zeros(0)]
    for camera, picture in zip(cameras, pictures, strict=True):
        ends, length = straight_edges(picture)
        rays = [
            np.c_[(ends[:, end] - camera.K[:2, 2]) / camera.K[(0, 1), (0, 1)], np.ones(len(ends))] for end in (0, 1)
        ]
        plane = np.cross(rays[0], rays[1])
        plane /= np.maximum(np.linalg.norm(plane, axis=1, keepdims=True), 1e-12)
        normals.append(camera.turned_to_world(plane))
        weights.append(length)
    return np.concatenate(normals), np.concatenate(weights)


def straight_edges(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2, 2) both ends of the edges in a photo (H, W, 3) RGB, in its pixels, and (N,) lengths over its width."""
    height, width = picture.shape[:2]
    scale = min(1.0, WIDTH / width)
    size = round(width * scale), round(height * scale)
    grey = cv2.cvtColor(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
    found = cv2.createLineSegmentDetector().detect(grey)[0]
    if found is None:
        return np.zeros((0, 2, 2)), np.zeros(0)
    ends = (found.reshape(-1, 2, 2).astype(np.float64) + 0.5) * [width / size[0], height / size[1]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / width
    return ends[length > SHORTEST], length[length > SHORTEST]


def _heading(normals: np.ndarray, weights: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, bool]:
    """The horizontal direction of most edges, up to quarter turns; and whether enough edges have it."""
    first = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    if len(normals) < LEAST_LINES:
        return first, False
    # a plane meets the level plane in one direction: that of its edge, if the edge is level
    direction = np.cross(normals, up)
    length = np.linalg.norm(direction, axis=1)
    angle = np.arctan2(direction @ second, direction @ first) % (np.pi / 2)
    good = length > 0.2
    angle, weight = angle[good], weights[good]
    counts = np.bincount((angle / (np.pi / 2) * BINS).astype(np.int64) % BINS, weight, BINS)
    half = round(WINDOW_DEG / 90 * BINS)
    smooth = sum((np.roll(counts, shift) for shift in range(-half, half + 1)), start=np.zeros(BINS))
    mode = (smooth.argmax() + 0.5) / BINS * np.pi / 2
    off = (angle - mode + np.pi / 4) % (np.pi / 2) - np.pi / 4
    near = np.abs(off) < np.radians(WINDOW_DEG)
    expected = weight.sum() * 2 * WINDOW_DEG / 90
    agree = bool(near.any() and weight[near].sum() > MIN_PEAK * expected)
    if near.any():
        mode += float(np.average(off[near], weights=weight[near]))
    return np.cos(mode) * first + np.sin(mode) * second, agree
