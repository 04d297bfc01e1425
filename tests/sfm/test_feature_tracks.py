"""Which of a pair's matches make tracks: those that fit its own geometry, if that is near the given poses."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from room2dgs.geometry.camera import Camera
from room2dgs.sfm.feature_tracks import pair_inliers

K = np.array([[260.0, 0, 160], [0, 260.0, 120], [0, 0, 1]])
RIGHT, WRONG = 120, 60


def turned(camera: Camera, degrees: float) -> Camera:
    """About its own vertical axis."""
    pose = camera.cam_from_world.copy()
    pose[:3] = cv2.Rodrigues(np.array([0.0, np.radians(degrees), 0.0]))[0] @ pose[:3]
    return replace(camera, cam_from_world=pose)


def pair(wrong: int = WRONG) -> tuple[SimpleNamespace, Camera, Camera]:
    """Two cameras, and matches of which the first `RIGHT` are right."""
    rng = np.random.default_rng(0)
    pose = np.eye(4)
    pose[:3, 3] = 0.4, 0.05, 0.1
    first, second = Camera(K, 320, 240, np.eye(4)), turned(Camera(K, 320, 240, pose), 4)
    xyz = rng.uniform([-1.2, -0.9, 3.0], [1.2, 0.9, 6.0], (RIGHT, 3))
    anywhere = rng.uniform((0, 0), (320, 240), (2, wrong, 2))
    keypoints = tuple(
        np.concatenate([camera.project(xyz)[0] + rng.normal(0, 0.3, (RIGHT, 2)), more])
        for camera, more in zip((first, second), anywhere, strict=True)
    )
    of_pair = {(0, 1): np.repeat(np.arange(RIGHT + wrong, dtype=np.uint32)[:, None], 2, axis=1)}
    matches = SimpleNamespace(keypoints=keypoints, of_pair=of_pair, pixels=lambda _: keypoints)
    return matches, first, second


@pytest.mark.parametrize("off_deg", [0.0, 2.0])
def test_matches_that_fit_nothing_make_no_tracks_also_where_poses_are_off(off_deg):
    matches, first, second = pair()
    kept = pair_inliers(matches, (0, 1), first, turned(second, off_deg))
    assert (kept[:, 0] == kept[:, 1]).all()
    assert (kept[:, 0] < RIGHT).sum() > 0.97 * RIGHT
    assert (kept[:, 0] >= RIGHT).sum() < 0.1 * WRONG


def test_a_pair_far_from_the_poses_has_matched_a_look_alike():
    matches, first, second = pair(wrong=0)
    assert len(pair_inliers(matches, (0, 1), first, second)) > 0.97 * RIGHT
    sideways = np.eye(4)
    sideways[1, 3] = 0.6
    moved = replace(second, cam_from_world=sideways)
    assert not len(pair_inliers(matches, (0, 1), first, moved))
