"""Registration of one more photo to known points (resection)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from room2dgs.colmap import pycolmap
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.feature_tracks import FeatureTracks, pair_inliers
from room2dgs.sfm.matching import Matches, pinhole
from room2dgs.sfm.structure import parallax_deg, reprojection_errors, triangulated

ROUNDS = 3
LEAST_POINTS = 20
LOSS_PX = 1.0
CUT = 5.0
MIN_PARALLAX_DEG = 1.0


def known_points(feature_tracks: FeatureTracks, cameras: Sequence[Camera]) -> np.ndarray:
    """(M, 3) metres: the tracks' points, NaN where an observation is far off or the rays are almost parallel."""
    tracks = feature_tracks.tracks
    xyz = triangulated(cameras, tracks)
    if len(xyz):
        start = np.flatnonzero(np.diff(tracks.point, prepend=-1))
        worst = np.maximum.reduceat(reprojection_errors(cameras, xyz, tracks), start)
        with np.errstate(invalid="ignore"):
            xyz[~((worst <= CUT * LOSS_PX) & (parallax_deg(cameras, xyz, tracks) >= MIN_PARALLAX_DEG))] = np.nan
    return xyz


def resected(
    photo: int,
    given: Camera,
    matches: Matches,
    feature_tracks: FeatureTracks,
    xyz: np.ndarray,
    cameras: Sequence[Camera],
    sigma_m: float,
) -> Camera | None:
    """The photo's pose that fits the points of the tracks its features match; nothing else is adjusted.

    Args:
        photo: index in `matches`.
        given: its camera with a pose that is a little off.
        xyz: (M, 3) of the tracks' points, NaN for those that do not count.
        cameras: of the photos that the tracks join.
        sigma_m: how far the given centre may be off.

    Returns:
        None with fewer than 20 points.
    """
    point_of = {
        (frame, feature): point
        for frame, feature, point in zip(
            feature_tracks.tracks.frame.tolist(),
            feature_tracks.feature.tolist(),
            feature_tracks.tracks.point.tolist(),
            strict=True,
        )
    }
    seen: dict[int, int] = {}  # feature of the photo -> point
    for i, j in sorted(matches.of_pair):
        if photo not in (i, j) or min(i, j) >= len(cameras):
            continue
        other = j if i == photo else i
        ends = (cameras[other], given) if i == other else (given, cameras[other])
        inliers = pair_inliers(matches, (i, j), *ends)
        for own, its in (inliers if i == photo else inliers[:, ::-1]).tolist():
            point = point_of.get((other, its), -1)
            if point >= 0 and np.isfinite(xyz[point, 0]):
                seen.setdefault(own, point)
    if len(seen) < LEAST_POINTS:
        return None
    pixel = matches.keypoints[photo][list(seen)]
    return _fitted(given, xyz[list(seen.values())], pixel, sigma_m)


def _fitted(given: Camera, xyz: np.ndarray, pixel: np.ndarray, sigma_m: float) -> Camera | None:
    camera = given
    for _ in range(ROUNDS):
        error = np.linalg.norm(camera.project(xyz)[0] - pixel, axis=1)
        error[np.isnan(error)] = np.inf
        scale = max(LOSS_PX, float(np.median(error)))
        near = error <= CUT * scale
        if not np.isfinite(scale) or np.count_nonzero(near) < LEAST_POINTS:
            return None
        options = pycolmap.AbsolutePoseRefinementOptions()
        options.loss_function_scale = scale
        options.gradient_tolerance = 1e-4
        options.use_position_prior = True
        options.position_prior_in_world = given.centre
        options.position_prior_covariance = sigma_m**2 * np.eye(3)
        pose = pycolmap.Rigid3d(camera.cam_from_world[:3])
        answer = pycolmap.refine_absolute_pose(pose, pixel, xyz, near, pinhole(camera), options)
        if answer is None:
            return None
        cam_from_world = np.eye(4)
        cam_from_world[:3] = answer["cam_from_world"].matrix()
        camera = replace(camera, cam_from_world=cam_from_world)
    return camera
