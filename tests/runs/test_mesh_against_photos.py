"""A mesh against the photos: coverage, and the correlation of photos over the mesh."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.runs.mesh_against_photos import (
    SmallView,
    mesh_coverage,
    photo_agreement,
    small_view,
    window_correlation,
)


@pytest.fixture(scope="module")
def frames(wall):
    return read_scene(load_config([f"scene.path={wall}", "out=unused", "scene.test_every=0"]).scene).train


@pytest.fixture(scope="module")
def truth(wall):
    return trimesh.load(wall / "gt_mesh.ply", process=False)


def measured(mesh, frames, measure):
    surface = Surface(mesh)
    return measure(frames, cache(lambda index: small_view(frames[index], surface)))


def test_photos_agree_over_the_true_wall(frames, truth):
    assert measured(truth, frames, photo_agreement) > 0.9


def two_views(depth_m: float, hidden: bool = False):
    """Two views of a plane with a random pattern, 2 m away, and what they see of a mesh that is `depth_m` away."""
    pattern = cv2.GaussianBlur(np.random.default_rng(0).uniform(0, 255, (60, 100)), (0, 0), 1.0).astype(np.float32)
    K = np.array([[80.0, 0, 40], [0, 80.0, 30], [0, 0, 1]])
    views = []
    for shift_m in (0.0, 0.25):  # 10 pixels at 2 m
        cam_from_world = np.eye(4)
        cam_from_world[0, 3] = -shift_m
        start = round(shift_m * 80 / 2)
        depth = np.full((60, 80), depth_m, np.float32)
        if hidden and shift_m:
            depth[:] = depth_m / 2  # something stands before the second camera
        grey = np.ascontiguousarray(pattern[:, start : start + 80])
        views.append(SmallView(Camera(K, 80, 60, cam_from_world), grey, np.ones((60, 80), bool), depth))
    return views


def test_windows_agree_at_the_true_depth_alone():
    assert np.median(window_correlation(*two_views(2.0))) > 0.99
    assert np.median(window_correlation(*two_views(1.5))) < 0.3


def test_windows_that_the_other_view_does_not_see_are_not_compared():
    whole = len(window_correlation(*two_views(2.0)))
    assert 0.6 * 60 * 80 < whole < (80 - 10) * 60  # the windows on the rims and the ten columns outside are not
    assert len(window_correlation(*two_views(2.0, hidden=True))) == 0


def test_they_do_not_with_the_poses_of_other_photos(frames, truth):
    others = np.random.default_rng(0).permutation(len(frames))
    mixed = [replace(frame, camera=frames[other].camera) for frame, other in zip(frames, others, strict=True)]
    assert measured(truth, mixed, photo_agreement) < 0.4


def test_agreement_is_unknown_where_no_two_views_see_the_mesh(frames, truth):
    assert measured(truth, frames[:1], photo_agreement) is None
    behind = truth.copy()
    behind.vertices[:, 2] = -2
    assert measured(behind, frames, photo_agreement) is None


def test_coverage_is_the_share_of_pixels_whose_ray_hits(frames, truth):
    assert measured(truth, frames, mesh_coverage) == pytest.approx(1.0, abs=0.01)
    camera = frames[3].camera
    inside = camera.project(np.asarray(truth.triangles_center))[0][:, 0] < camera.width / 2
    half = trimesh.Trimesh(truth.vertices, truth.faces[inside], process=False)
    assert measured(half, frames[3:4], mesh_coverage) == pytest.approx(0.5, abs=0.1)
