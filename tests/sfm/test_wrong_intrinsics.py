"""What the tracks of a capture's points say of intrinsics that are wrong for all photos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.capture_points import capture_points
from room2dgs.sfm.wrong_intrinsics import intrinsics_off


@pytest.fixture
def scene_with(scene_config):
    """`scene_with(change, noise)`: a scene and its tracks, and cameras whose K has what `change` makes of it."""
    scene = read_scene(scene_config())
    random = np.random.default_rng(0)
    xyz = random.uniform(0.05, 1.2, (300, 3))
    xyz[np.arange(300), random.integers(0, 3, 300)] = 0.0

    def make(change, noise=0.0):
        parts = []
        for index, frame in enumerate(scene.train):
            pixel, _ = frame.camera.project(xyz)
            seen = np.flatnonzero(frame.camera.inside(pixel))
            at = pixel[seen] + random.normal(scale=0.3, size=(len(seen), 2))
            wrong = random.random(len(seen)) < noise
            at[wrong] = random.uniform((0, 0), frame.camera.size, (int(wrong.sum()), 2))
            parts.append((np.full(len(seen), index, np.int32), seen.astype(np.int32), at.astype(np.float32)))
        tracks = Tracks(
            tuple(frame.name for frame in scene.train), *(np.concatenate(part) for part in zip(*parts, strict=True))
        )
        cloud = PointCloud(xyz, np.zeros((300, 3), np.uint8), tracks)
        frames = tuple(replace(frame, camera=changed(frame.camera, change)) for frame in scene.train)
        return replace(scene, train=frames, given_points=lambda: cloud), cloud

    return make


def changed(camera: Camera, change) -> Camera:
    K = camera.K.copy()
    change(K)
    return Camera(K, *camera.size, camera.cam_from_world)


def shift(K: np.ndarray) -> None:
    K[0, 2] += 12.0
    K[1, 2] -= 7.0


def stretch(K: np.ndarray) -> None:
    K[:2, :2] *= 1.25


def both(K: np.ndarray) -> None:
    shift(K)
    stretch(K)


@pytest.mark.parametrize(
    ("change", "said"),
    [(shift, "the principal point is wrong"), (stretch, "the focal length is wrong"), (both, "intrinsics are wrong")],
)
def test_the_sentence_names_what_is_wrong_and_the_right_numbers(scene_with, points_config, change, said):
    scene, cloud = scene_with(change, noise=0.1)
    true = scene_with(lambda K: None)[0].train[0].camera
    with pytest.raises(InputError, match=said) as error:
        capture_points(scene, points_config, lambda line: None)
    off = intrinsics_off(cloud, scene.train, 2.0)
    width, height = true.size
    K = scene.train[0].camera.K
    assert off.focal * K[0, 0] == pytest.approx(true.K[0, 0], rel=0.01)
    assert K[0, 2] + off.shift[0] * width == pytest.approx(true.K[0, 2], abs=1.0)
    assert K[1, 2] + off.shift[1] * height == pytest.approx(true.K[1, 2], abs=1.0)
    if change is shift:
        assert f"({K[0, 2]:.1f}, {K[1, 2]:.1f})" in str(error.value)


def test_right_intrinsics_and_points_of_elsewhere_are_not_explained_so(scene_with, points_config):
    scene, cloud = scene_with(lambda K: None, noise=0.2)
    assert capture_points(scene, points_config, lambda line: None) is not None
    moved = PointCloud(cloud.xyz + np.array([0.4, 0.0, 0.2]), cloud.rgb, cloud.tracks)
    assert intrinsics_off(moved, scene.train, 2.0) is None


def test_left_out_points_are_told(scene_with, points_config):
    scene, cloud = scene_with(lambda K: None)
    lines = []
    capture_points(replace(scene, given_points=lambda: replace(cloud, left_out=12)), points_config, lines.append)
    assert lines[0].startswith("points: 12 of the capture are left out")
