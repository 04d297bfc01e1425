"""Wrong poses against wrong matches: cameras that look into a cloud of points, with matches of known worth."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from room2dgs.geometry.camera import Camera
from room2dgs.sfm.contradiction import pose_error, verdict

K = np.array([[260.0, 0, 160], [0, 260.0, 120], [0, 0, 1]])
VIEWS, POINTS = 7, 120


def cameras(step_m: float) -> list[Camera]:
    rng = np.random.default_rng(0)
    found = []
    for _ in range(VIEWS):
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(rng.uniform(-0.3, 0.3, 3))[0]
        pose[:3, 3] = -pose[:3, :3] @ (step_m * rng.uniform(-1, 1, 3))
        found.append(Camera(K, 320, 240, pose))
    return found


def matches(views: list[Camera], worthless: float, good_pairs: int):
    """Of all pairs but the first few, that share of the matches is drawn anywhere."""
    rng = np.random.default_rng(1)
    xyz = rng.uniform([-1.5, -1.2, 3.0], [1.5, 1.2, 6.0], (POINTS, 3))
    seen = [view.project(xyz)[0] + rng.normal(0, 0.3, (POINTS, 2)) for view in views]
    pairs = [(i, j) for i in range(VIEWS) for j in range(i + 1, VIEWS)]
    pixels = {}
    for index, (i, j) in enumerate(pairs):
        second = seen[j].copy()
        wrong = rng.random(POINTS) < (0 if index < good_pairs else worthless)
        second[wrong] = rng.uniform((0, 0), (320, 240), (wrong.sum(), 2))
        pixels[i, j] = (seen[i], second)
    return SimpleNamespace(of_pair={pair: np.arange(POINTS) for pair in pairs}, pixels=pixels.__getitem__), pairs


def shuffled(views: list[Camera]) -> list[Camera]:
    return [replace(view, cam_from_world=views[i - 1].cam_from_world) for i, view in enumerate(views)]


def zoomed(views: list[Camera]) -> list[Camera]:
    return [replace(view, K=K * [[1.4, 1, 1], [1, 1.4, 1], [1, 1, 1]]) for view in views]


@pytest.mark.parametrize("step_m", [0.6, 0.004, 0.0])
def test_right_poses_are_confirmed_by_the_few_pairs_that_fit_and_wrong_ones_contradicted(step_m):
    """A fifth of all matches are right, as where photos hardly overlap; whether the cameras moved or only turned."""
    views = cameras(step_m)
    found, pairs = matches(views, worthless=0.97, good_pairs=4)
    right = sum((pose_error(views[i], views[j], *found.pixels((i, j))) < 2).sum() for i, j in pairs)
    assert right < 0.26 * POINTS * len(pairs)
    asked = verdict(found, views, pairs)
    assert asked.confirmed and not asked.contradicted and asked.inlier_share > 0.9
    for wrong in (shuffled(views), zoomed(views)):
        assert verdict(found, wrong, pairs).contradicted


def test_matches_that_are_all_wrong_say_nothing_of_poses():
    views = cameras(0.6)
    found, pairs = matches(views, worthless=1.0, good_pairs=0)
    asked = verdict(found, views, pairs)
    assert not asked.confirmed and not asked.contradicted


def test_of_cameras_in_one_place_a_match_lies_where_the_rotation_takes_it():
    first, second = cameras(0.0)[:2]
    ray = np.array([[0.1, -0.2, 1.0]])
    pixels = [camera.project(camera.centre + ray @ first.rotation)[0] for camera in (first, second)]
    off = pose_error(first, second, pixels[0], pixels[1] + [[3.0, 4.0]])
    np.testing.assert_allclose(pose_error(first, second, *pixels), 0, atol=1e-9)
    np.testing.assert_allclose(off, 5.0, rtol=1e-9)
