"""A focal length that is a little wrong is mended with the poses: reprojection errors hardly tell it, depth does."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.poses_file import read_poses, write_poses
from room2dgs.captures.read import read_scene
from room2dgs.captures.with_lens import with_focal
from room2dgs.config import SfmConfig
from room2dgs.errors import InputError
from room2dgs.sfm import bundle
from room2dgs.sfm.adjust import adjusted, consistent
from room2dgs.sfm.bundle import FOCAL_SPREAD, Spread, focal_adjusted
from room2dgs.sfm.refinement import PoseReport, _lines, refined_poses
from room2dgs.sfm.structure import triangulated
from tests.sfm.test_refine_poses import K, quiet, ring, seen, shake_capture, shaken


def zoomed(cameras, factor: float):
    return [camera.zoomed(factor) for camera in cameras]


def depth_scale(cameras, tracks) -> float:
    """By how much points are too far from their cameras, in the middle."""
    far = [
        np.linalg.norm(
            triangulated(some, tracks)[tracks.point] - np.stack([c.centre for c in some])[tracks.frame], axis=1
        )
        for some in (cameras, ring())
    ]
    return float(np.nanmedian(far[0] / far[1]))


@pytest.mark.parametrize("wrong, degrees, metres", [(1.0, 0.0, 0.0), (1.015, 0.0, 0.0), (0.985, 0.4, 0.01)])
def test_a_wrong_focal_length_comes_back_and_the_scale_of_the_depth_with_it(wrong, degrees, metres):
    given, tracks = zoomed(shaken(ring(), degrees, metres), wrong), seen(ring(), 800)
    free = adjusted(given, tracks, focal=True)
    assert free.known.all() and all(camera.K[0, 0] == free.cameras[0].K[0, 0] for camera in free.cameras)
    assert free.cameras[0].K[0, 0] == pytest.approx(K[0, 0], rel=0.002)
    np.testing.assert_array_equal(free.cameras[0].K[:2, 2], K[:2, 2])
    assert free.cameras[0].K[0, 0] / free.cameras[0].K[1, 1] == pytest.approx(K[0, 0] / K[1, 1], rel=1e-9)
    assert depth_scale(free.cameras, tracks) == pytest.approx(1, abs=0.002)


def test_a_focal_length_that_is_not_to_change_does_not():
    given = zoomed(ring(), 1.015)
    assert all(np.array_equal(one.K, given[0].K) for one in adjusted(given, seen(ring(), 400), rounds=1).cameras)


def test_cameras_with_intrinsics_of_their_own_keep_them():
    given = [camera.zoomed(1.01 if index % 2 else 0.99) for index, camera in enumerate(ring())]
    found = adjusted(given, seen(ring(), 600), focal=True).cameras
    assert all(np.array_equal(one.K, old.K) for one, old in zip(found, given, strict=True))


def test_a_change_by_its_spread_costs_what_an_observation_of_that_noise_does(monkeypatch):
    rebuilt, spread = [], Spread(0.01, 0.05, 0.5)
    solved = bundle._solved
    monkeypatch.setattr(bundle, "_solved", lambda *args: rebuilt.append(solved(*args)) or rebuilt[0])
    given = zoomed(ring(), 1.01)
    fitting, xyz, loss_px = consistent(given, seen(ring(), 400))
    focal_adjusted(given, given, fitting, xyz, loss_px, spread)
    image = rebuilt[0].image(bundle.FOCAL_ID)
    camera = rebuilt[0].camera(1)
    camera.focal_length = given[0].K[0, 0] * (1 + FOCAL_SPREAD)
    points = [rebuilt[0].point3D(two.point3D_id).xyz for two in image.points2D]
    off = [
        camera.img_from_cam(image.cam_from_world() * xyz) - two.xy
        for xyz, two in zip(points, image.points2D, strict=True)
    ]
    assert np.square(off).sum() == pytest.approx(spread.pixels**2, rel=1e-6)


def test_the_pixels_of_a_depth_map_stay_with_those_of_the_photo():
    camera = ring()[0]
    depth = np.random.default_rng(0).uniform(1, 4, (camera.height, camera.width)).astype(np.float32)
    own = DepthMap("test", lambda: depth, 1.0, tuple(map(tuple, camera.K)))
    np.testing.assert_array_equal(own.seen_by(camera, None), depth)
    later = replace(own, zoom=1.01)
    np.testing.assert_array_equal(later.seen_by(camera.zoomed(1.01), None), depth)


def test_a_refined_capture_has_one_focal_length_that_a_later_run_reads(capture, scene_config, points_config, tmp_path):
    shake_capture(capture, 0.3, 0.008)
    path = capture / "intrinsic" / "intrinsic_color.txt"
    K_on_disk = np.loadtxt(path)
    K_on_disk[(0, 1), (0, 1)] *= 1.01
    np.savetxt(path, K_on_disk)
    scene = read_scene(scene_config())
    found, report = refined_poses(scene, SfmConfig(True, True, True), points_config, tmp_path, quiet)
    assert report["refined"] and report["focal"] == pytest.approx(1 / 1.01, abs=0.006)
    for before, after in zip(scene.frames, found.frames, strict=True):
        np.testing.assert_array_equal(after.camera.K, before.camera.zoomed(report["focal"]).K)
    write_poses(tmp_path / "poses.json", scene, found, report)
    again, _ = read_poses(tmp_path / "poses.json", scene)
    for one, other in zip(again.frames, found.frames, strict=True):
        np.testing.assert_array_equal(one.camera.K, other.camera.K)
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    kept, report = refined_poses(scene, SfmConfig(True, True, False), points_config, tmp_path, quiet)
    assert report["focal"] is None
    assert all(np.array_equal(a.camera.K, b.camera.K) for a, b in zip(kept.frames, scene.frames, strict=True))


@pytest.mark.parametrize("factor", [0.0, -1.0, 3.0, float("inf"), "wide"])
def test_a_file_with_an_impossible_focal_length_is_named(scene_config, tmp_path, factor):
    scene = read_scene(scene_config())
    path = tmp_path / "poses.json"
    write_poses(path, scene, scene, {})
    content = json.loads(path.read_text())
    content["report"]["focal"] = factor
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"poses\.json is not a file of refined poses"):
        read_poses(path, scene)


def test_points_that_came_with_the_capture_go_with_the_old_focal_length(scene_config):
    scene = read_scene(scene_config())
    assert with_focal(scene, 1.01).given_points is None


def test_a_focal_length_that_changed_is_said():
    report = PoseReport(True, "", 1.0, 0.5, 0.5, 0.9, 0.01, 0.1, focal=0.991)
    assert any("0.9910 times the given ones" in line for line in _lines(report))
    assert not any("focal" in line for line in _lines(replace(report, focal=1.001)))
