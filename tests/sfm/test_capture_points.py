"""Points that the capture brings, in place of matching its photos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from room2dgs.sfm.capture_points import capture_points
from room2dgs.sfm.sparse import sparse_points


@pytest.fixture
def brought(scene_config):
    """(scene, cloud): a scene that brings points on its walls, with the pixels at which every view sees them."""
    scene = read_scene(scene_config())
    random = np.random.default_rng(0)
    xyz = random.uniform(0.05, 1.2, (900, 3))
    xyz[np.arange(900), random.integers(0, 3, 900)] = 0.0
    parts = []
    for index, frame in enumerate(scene.train):
        pixel, _ = frame.camera.project(xyz)
        seen = np.flatnonzero(frame.camera.inside(pixel))
        parts.append((np.full(len(seen), index, np.int32), seen.astype(np.int32), pixel[seen].astype(np.float32)))
    tracks = Tracks(
        tuple(frame.name for frame in scene.train), *(np.concatenate(part) for part in zip(*parts, strict=True))
    )
    cloud = PointCloud(xyz, np.zeros((900, 3), np.uint8), tracks)
    return replace(scene, given_points=lambda: cloud), cloud


def no_log(line: str) -> None:
    """Takes a line and drops it."""


def test_points_that_fit_spare_the_matching(brought, points_config, tmp_path):
    scene, cloud = brought
    points = sparse_points(scene, points_config, tmp_path / "cache", no_log)
    often = cloud.track_length >= points_config.min_track
    np.testing.assert_array_equal(points.xyz, cloud.xyz[often])
    assert not (tmp_path / "cache").exists()  # nothing was triangulated


def test_observations_that_lie_elsewhere_do_not_count(brought, points_config):
    scene, cloud = brought
    tracks = cloud.tracks
    pixel = tracks.pixel.copy()
    wrong = np.flatnonzero(tracks.point < 100)
    pixel[wrong] += 30
    spoilt = PointCloud(cloud.xyz, cloud.rgb, Tracks(tracks.frames, tracks.frame, tracks.point, pixel))
    points = capture_points(replace(scene, given_points=lambda: spoilt), points_config, no_log)
    rest = np.flatnonzero(cloud.track_length >= points_config.min_track)
    np.testing.assert_array_equal(points.xyz, cloud.xyz[rest[rest >= 100]])


def test_points_of_another_model_are_refused(brought, points_config):
    scene, cloud = brought
    moved = PointCloud(cloud.xyz + np.array([0.4, 0.0, 0.2]), cloud.rgb, cloud.tracks)
    with pytest.raises(InputError, match="do not lie where its photos saw them"):
        capture_points(replace(scene, given_points=lambda: moved), points_config, no_log)


def test_few_points_and_points_without_tracks_are_left(brought, points_config):
    scene, cloud = brought
    few = cloud.chosen(np.arange(900) < 30)
    lines = []
    assert capture_points(replace(scene, given_points=lambda: few), points_config, lines.append) is None
    bare = PointCloud(cloud.xyz, cloud.rgb)
    assert capture_points(replace(scene, given_points=lambda: bare), points_config, lines.append) is None
    assert len(lines) == 2 and all("photos are matched" in line for line in lines)
