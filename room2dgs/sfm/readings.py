"""Poses that do not fit their photos: whether another pose convention or focal length would make them fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from room2dgs.captures.capture import Poses, disk_pose, world_from_cam
from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose
from room2dgs.sfm.matching import IndexPairs, Matches, epipolar_inlier_share

# Pairs with most matches that are tried, enough to tell 90 % from 10 %.
MOST_PAIRS = 12
LEAST_SHARE = 0.5  # of the matches; true poses reach 0.7
COARSE, FINE = 1.1, 1.015  # steps of the focal length
FACTORS = COARSE ** np.arange(-10, 11)  # 0.39 to 2.6
POSE_DESCRIPTIONS: dict[Poses, str] = {
    "camera_to_world_opencv": "camera-to-world with OpenCV axes (x right, y down, z forward)",
    "camera_to_world_opengl": "camera-to-world with OpenGL axes (x right, y up, z back)",
    "world_to_camera_opencv": "world-to-camera with OpenCV axes (x right, y down, z forward)",
    "world_to_camera_opengl": "world-to-camera with OpenGL axes (x right, y up, z back)",
}


def better_reading(
    matches: Matches, cameras: Sequence[Camera], pairs: IndexPairs, max_px: float
) -> tuple[Poses, float] | None:
    """The pose convention with which most matches lie on their epipolar lines.

    Tried are the four conventions: camera-to-world or world-to-camera, OpenCV's axes or OpenGL's.

    Args:
        cameras: as they were read.

    Returns:
        The value of `scene.poses` and its share of inliers; None if no other convention fits.
    """
    best_matched = _best_matched(matches, pairs)
    read_as = [frame.poses for frame in matches.frames]
    shares = {}
    for poses in POSE_DESCRIPTIONS:
        # a camera that stands as another does has no epipolar lines
        other = [read_again(camera, was, poses) for camera, was in zip(cameras, read_as, strict=False)]
        apart = [(i, j) for i, j in best_matched if np.linalg.norm(other[i].centre - other[j].centre) > 1e-6]
        shares[poses] = epipolar_inlier_share(matches, other, apart, max_px)
    best = max(shares, key=lambda poses: shares[poses])
    if shares[best] < LEAST_SHARE or best == read_as[0]:
        return None
    return best, shares[best]


def better_focal(
    matches: Matches, cameras: Sequence[Camera], pairs: IndexPairs, max_px: float
) -> tuple[float, float] | None:
    """The factor of all focal lengths with which most matches lie on their epipolar lines.

    Returns:
        The factor and its share of the matches; None if none fits.
    """
    best_matched = _best_matched(matches, pairs)

    def share(factor: float) -> float:
        return epipolar_inlier_share(matches, [camera.zoomed(factor) for camera in cameras], best_matched, max_px)

    fine = max(FACTORS, key=share) * FINE ** np.arange(-9, 10)
    shares = np.array([share(factor) for factor in fine])
    # the middle of those that hold as good as all
    factor = float(np.exp(np.log(fine[shares >= 0.99 * shares.max()]).mean()))
    best = share(factor)
    return None if best < LEAST_SHARE else (factor, best)


def intrinsics_setting(frame: Frame, factor: float) -> str:
    """The setting that gives a photo's intrinsics another focal length."""
    if frame.lens is not None:
        return f"focal lengths {factor:.2f} times those of the capture"
    K = frame.camera.zoomed(factor).K
    x, y = np.array(frame.source.size()) / frame.camera.size
    values = ",".join(f"{value:.4g}" for value in (K[0, 0] * x, K[1, 1] * y, K[0, 2] * x, K[1, 2] * y))
    return f"scene.intrinsics=[{values}]"


def _best_matched(matches: Matches, pairs: IndexPairs) -> IndexPairs:
    best_matched = sorted(
        (pair for pair in pairs if pair in matches.of_pair), key=lambda pair: -len(matches.of_pair[pair])
    )
    return best_matched[:MOST_PAIRS]


def read_again(camera: Camera, was: Poses, poses: Poses) -> Camera:
    """The camera that another pose convention gives for the same numbers on disk."""
    pose = world_from_cam(disk_pose(camera.world_from_cam, was), poses)
    return replace(camera, cam_from_world=inverse_pose(pose))
