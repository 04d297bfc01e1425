"""Wrong intrinsics recognised by points: one shift or one scale explains most reprojection errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame

ENOUGH = 100  # observations to judge by
ROUNDS = 10
EXPLAINED = 0.8  # of the observations, which one shift and one factor bring to where they were seen
SAME_FOCAL = 0.02  # relative


class Off(NamedTuple):
    """The error of all photos' intrinsics, estimated from points.

    Attributes:
        focal: factor of the focal lengths that would be right.
        shift: (x, y) to be added to the principal point, as shares of width and height.
    """

    focal: float
    shift: tuple[float, float]


def intrinsics_off(points: PointCloud, frames: Sequence[Frame], limit_px: float) -> Off | None:
    """The focal factor and principal point shift that explain most observations; None: none does.

    Args:
        points: with tracks.
        limit_px: how far from its place an observation may be, in a photo of the first frame's size.
    """
    cameras = {frame.name: frame.camera for frame in frames}
    tracks = points.known_tracks
    rays, seen = [], []
    for index, name in enumerate(tracks.frames):
        camera = cameras[name]
        rows = np.flatnonzero(tracks.frame == index)
        at = camera.to_camera(points.xyz[tracks.point[rows]])
        front = at[:, 2] > 0
        side = np.array(camera.size, np.float64)
        focal, middle = camera.K[(0, 1), (0, 1)] / side, camera.K[:2, 2] / side
        rays.append(at[front, :2] / at[front, 2:] * focal)
        seen.append(tracks.pixel[rows][front] / side - middle)
    ray, pixel = np.concatenate(rays), np.concatenate(seen)
    size: np.ndarray = np.array(cameras[tracks.frames[0]].size)
    finite = np.isfinite(ray).all(axis=1) & np.isfinite(pixel).all(axis=1)
    ray, pixel = ray[finite], pixel[finite]
    if len(ray) < ENOUGH:
        return None
    factor, shift = 1.0, np.median(pixel - ray, axis=0)
    for _ in range(ROUNDS):  # the better half tells the next guess
        error = np.linalg.norm((pixel - factor * ray - shift) * size, axis=1)
        half = error <= np.median(error)
        mean_ray, mean_pixel = ray[half].mean(axis=0), pixel[half].mean(axis=0)
        spread = ((ray[half] - mean_ray) ** 2).sum()
        if not spread > 0:
            return None
        factor = float(((ray[half] - mean_ray) * (pixel[half] - mean_pixel)).sum() / spread)
        shift = mean_pixel - factor * mean_ray
    error = np.linalg.norm((pixel - factor * ray - shift) * size, axis=1)
    if not factor > 0 or (error <= limit_px).mean() < EXPLAINED:
        return None
    return Off(factor, (float(shift[0]), float(shift[1])))


def wrong_intrinsics_sentence(off: Off, frame: Frame) -> str:
    """What is wrong with the intrinsics, in pixels of the working image of a frame."""
    K, (width, height) = frame.camera.K, frame.camera.size
    cx, cy = K[0, 2] + off.shift[0] * width, K[1, 2] + off.shift[1] * height
    middle = f"cx, cy are ({K[0, 2]:.1f}, {K[1, 2]:.1f}) and should be about ({cx:.1f}, {cy:.1f})"
    focal = f"fx, fy are ({K[0, 0]:.1f}, {K[1, 1]:.1f}) and should be about {off.focal:.3g} times that"
    of = f"of images of {width}x{height} pixels"
    if abs(off.focal - 1.0) <= SAME_FOCAL:
        return f"the principal point is wrong: {middle}, {of}"
    if max(abs(share) for share in off.shift) <= SAME_FOCAL:
        return f"the focal length is wrong: {focal}, {of}"
    return f"the intrinsics are wrong: {focal}, {middle}, {of}"
