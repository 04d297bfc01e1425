"""The sparse points of the capture itself, used without matching where they are good enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import PointsConfig
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.sfm.wrong_intrinsics import intrinsics_off, wrong_intrinsics_sentence

# Fewer have no neighbourhood to take normals from.
MIN_POINTS = 16
# Photos with fewer points than this, on average, are matched anew.
LEAST_A_VIEW = 20
# Of the observations; poses and points of one model agree in nearly all.
MIN_INLIER_SHARE = 0.5
MAX_ERROR = 2 / 640  # of the photo's longer side


def capture_points(scene: Scene, config: PointsConfig, log: Log) -> PointCloud | None:
    """The capture's points with at least `config.min_track` inlier observations in training views.

    Observations of held-out views are not used here, although the capture's maker triangulated with them.

    Returns:
        With tracks; None if the capture has none, or too few points.

    Raises:
        InputError: poses and points do not belong together.
    """
    assert scene.given_points is not None, "the capture brings no points"
    points = scene.given_points()
    if points.tracks is None:
        log(f"points: the capture's {len(points)} have no tracks, so photos are matched")
        return None
    if points.left_out:
        log(f"points: {points.left_out:,} of the capture are left out, which are not finite or lie at 0, 0, 0")
    inlier, error = reprojected(points, scene.train)
    count, share = len(inlier), float(inlier.mean()) if len(inlier) else 0.0
    off = None
    if count and share < MIN_INLIER_SHARE:
        off = intrinsics_off(points, scene.train, max(1.0, MAX_ERROR * max(scene.train[0].camera.size)))
    if off is not None:
        raise InputError(
            f"{scene.path} has sparse points that do not lie where its photos saw them ({100 * share:.0f} % of "
            f"{count} observations agree): {wrong_intrinsics_sentence(off, scene.train[0])}; correct them"
        )
    if count >= 1000 and share < MIN_INLIER_SHARE:
        raise InputError(
            f"{scene.path} has sparse points that do not lie where its photos saw them ({100 * share:.0f} % of "
            f"{count} observations agree); export poses and points together, or give points.source=sfm"
        )
    tracks = points.tracks
    tracks = Tracks(tracks.frames, tracks.frame[inlier], tracks.point[inlier], tracks.pixel[inlier])
    points = PointCloud(points.xyz, points.rgb, tracks)
    points = points.chosen((points.track_length >= config.min_track) & np.isfinite(points.xyz).all(axis=1))
    if len(points) < max(MIN_POINTS, LEAST_A_VIEW * len(scene.train)):
        log(f"points: the capture has {len(points)} that {config.min_track} views saw, so photos are matched")
        return None
    log(
        f"points: {len(points)} of the capture, seen by {points.track_length.mean():.1f} training views on average, "
        f"median error {np.median(error[inlier]):.2f} px"
    )
    return points


def reprojected(points: PointCloud, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
    """Which observations are inliers: near the projection of their point.

    Returns:
        (O,) bool: in front of the camera and within `MAX_ERROR`, at least a pixel; (O,) float64 distance in pixels.
    """
    cameras = {frame.name: frame.camera for frame in frames}
    tracks = points.known_tracks
    error = np.full(len(tracks), np.inf)
    limit = np.zeros(len(tracks))
    for index, name in enumerate(tracks.frames):
        rows = np.flatnonzero(tracks.frame == index)
        pixel, _ = cameras[name].project(points.xyz[tracks.point[rows]])
        distance = np.linalg.norm(pixel - tracks.pixel[rows], axis=1)
        error[rows] = np.where(np.isfinite(distance), distance, np.inf)
        limit[rows] = max(1.0, MAX_ERROR * max(cameras[name].size))
    return error <= limit, error
