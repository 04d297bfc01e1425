"""Photos that were not taken by the pinhole camera that a capture gives tell so, and are straightened."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from room2dgs.captures.lens import Lens, pinhole_of
from room2dgs.captures.point_cloud import Tracks
from room2dgs.captures.poses_file import read_poses, write_poses
from room2dgs.captures.read import read_scene
from room2dgs.captures.with_lens import with_lens
from room2dgs.config import SfmConfig
from room2dgs.errors import InputError
from room2dgs.sfm import bundle
from room2dgs.sfm import lens as module
from room2dgs.sfm.adjust import consistent
from room2dgs.sfm.bundle import Spread
from room2dgs.sfm.lens import found_lens, straightened
from room2dgs.sfm.refinement import _may_be_distorted, refined_poses
from room2dgs.sfm.sparse import sparse_points
from tests.sfm.test_refine_poses import K, quiet, ring, seen, shaken

LENS = Lens("OPENCV", (260.0 * 0.99, 255.0 * 0.995, 160.0, 118.0, 0.06, -0.05, 0.001, -0.0005), (320, 240), "test")
FOUND = SfmConfig("auto", True, True)


def through(lens: Lens, tracks: Tracks) -> Tracks:
    """Observations of a pinhole camera with `K`, as a lens has them."""
    rays = np.column_stack([(tracks.pixel - K[:2, 2]) / K[(0, 1), (0, 1)], np.ones(len(tracks))])
    return Tracks(tracks.frames, tracks.frame, tracks.point, lens.project(rays).astype(np.float32))


@pytest.mark.parametrize("degrees, metres", [(0.0, 0.0), (0.3, 0.005)])
def test_tracks_tell_the_lens(degrees, metres):
    tracks = through(LENS, seen(ring(), 1200))
    found = found_lens(shaken(ring(), degrees, metres), tracks)
    assert found is not None and found.after_px < 0.9 * found.before_px
    np.testing.assert_allclose(found.focal, (0.99, 0.995), atol=0.002)
    grid = np.stack(np.meshgrid(np.linspace(10, 310, 13), np.linspace(10, 230, 10)), axis=-1).reshape(-1, 2)
    rays = np.column_stack([(grid - K[:2, 2]) / K[(0, 1), (0, 1)], np.ones(len(grid))])
    assert np.linalg.norm(found.lens.project(rays) - LENS.project(rays), axis=1).max() < 0.5
    assert 0.5 < found.moved_px < 3
    straight = straightened(tracks, LENS, ring()[0])
    np.testing.assert_allclose(through(LENS, straight).pixel, tracks.pixel, atol=1e-3)


@pytest.mark.parametrize("degrees, metres", [(0.0, 0.0), (1.0, 0.02)])
def test_a_pinhole_camera_stays_one_whatever_its_poses(degrees, metres):
    assert found_lens(shaken(ring(), degrees, metres), seen(ring(), 1200)) is None


def test_what_a_free_lens_gains_by_chance_is_no_lens(monkeypatch):
    monkeypatch.setattr(module, "LEAST_PX", 0.0)
    assert found_lens(ring(), seen(ring(), 1200)) is None


def test_what_holds_rotations_has_no_lens_to_give_way(monkeypatch):
    """Its focal length says how much a turn costs: free, it would go to where none does."""
    rebuilt, spread = [], Spread(0.01, 0.05, 0.5)
    solved = bundle._solved
    monkeypatch.setattr(bundle, "_solved", lambda *args: rebuilt.append(solved(*args)) or rebuilt[0])
    given, tracks = shaken(ring(), 0.3, 0.005), through(LENS, seen(ring(), 400))
    fitting, xyz, loss_px = consistent(given, tracks)
    bundle.lens_adjusted(given, given, fitting, xyz, loss_px, spread)
    np.testing.assert_array_equal(
        rebuilt[0].camera(bundle.PRIOR_IDS).params, bundle.rotation_prior_camera(spread).params
    )


def test_cameras_that_differ_and_few_tracks_tell_nothing():
    cameras, tracks = ring(), through(LENS, seen(ring(), 1200))
    assert found_lens([*cameras[:-1], cameras[-1].resized(640, 480)], tracks) is None
    few = tracks.point < module.LEAST_TRACKS - 1
    assert (
        found_lens(cameras, Tracks(tracks.frames, *(x[few] for x in (tracks.frame, tracks.point, tracks.pixel))))
        is None
    )


@pytest.fixture
def bent(capture):
    """The capture's photos as a lens would have taken them; its file still says that they are straight."""
    shutil.rmtree(capture / "depth", ignore_errors=True)
    paths = sorted((capture / "color").iterdir())
    height, width = cv2.imread(str(paths[0])).shape[:2]
    camera = np.loadtxt(capture / "intrinsic" / "intrinsic_color.txt")[:3, :3]
    bending = np.array([0.12, -0.05, 0, 0])
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 1, 2).astype(np.float64)
    shorter = camera * [[0.98], [0.98], [1.0]]
    shorter[:2, 2] = camera[:2, 2]
    where = cv2.undistortPoints(grid, shorter, bending, P=camera)
    maps = where.reshape(height, width, 2).astype(np.float32)
    straight = {path.stem: cv2.imread(str(path)) for path in paths}
    for path in paths:
        photo = cv2.remap(
            straight[path.stem], maps[..., 0], maps[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
        )
        path.unlink()
        cv2.imwrite(str(path.with_suffix(".png")), photo)
    return straight


def test_photos_of_a_lens_are_straightened_and_a_run_knows_it_again(
    bent, scene_config, points_config, tmp_path, monkeypatch
):
    monkeypatch.setattr(module, "LEAST_TRACKS", 100)
    scene, log = read_scene(scene_config()), []
    found, report = refined_poses(scene, FOUND, points_config, tmp_path / "cache", log.append)
    assert any(line.startswith("lens: focal lengths 0.9") for line in log)
    lens = Lens(report["lens"]["model"], tuple(report["lens"]["params"]), tuple(report["lens"]["size"]))
    np.testing.assert_allclose(np.diag(lens.K)[:2] / np.diag(scene.train[0].camera.K)[:2], 0.98, atol=0.01)
    assert report["lens"]["after_px"] < 0.9 * report["lens"]["before_px"]
    for frame in found.frames:
        assert frame.color().shape[1::-1] == frame.camera.size
        assert np.abs(np.array(frame.camera.size) / scene.train[0].camera.size - 1).max() < 0.1
    points = sparse_points(found, points_config, tmp_path / "cache", log.append)
    assert sum("matching" in line for line in log) == 2  # anew after the photos were straightened, not for the points
    assert len(points) > 100
    write_poses(tmp_path / "poses.json", scene, found, report)
    back, _ = read_poses(tmp_path / "poses.json", scene)
    again, _ = refined_poses(scene, FOUND, points_config, tmp_path / "cache", quiet)
    for one, *others in zip(found.frames, back.frames, again.frames, strict=True):
        for other in others:
            np.testing.assert_array_equal(one.color(), other.color())
            np.testing.assert_array_equal(one.camera.K, other.camera.K)
            np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    text = json.loads((tmp_path / "poses.json").read_text())
    text["report"]["lens"]["params"] = [1.0]
    (tmp_path / "poses.json").write_text(json.dumps(text))
    with pytest.raises(InputError, match=r"poses\.json"):
        read_poses(tmp_path / "poses.json", scene)
    off, report = refined_poses(scene, SfmConfig("auto", True, False), points_config, tmp_path / "cache", quiet)
    assert report["lens"] is None and all(frame.lens is None for frame in off.frames)


def test_no_lens_is_looked_for_beside_sensor_depth_or_a_lens_or_another_camera(bent, scene_config):
    scene = read_scene(scene_config())
    assert _may_be_distorted(scene)
    last = scene.test[-1]
    others = {"depth_path": last.color_path}, {"lens": LENS}, {"camera": last.camera.resized(160, 120)}
    for other in others:
        assert not _may_be_distorted(replace(scene, test=(*scene.test[:-1], replace(last, **other))))


def test_straightened_photos_show_what_a_pinhole_camera_would(bent, scene_config):
    scene = read_scene(scene_config())
    K_given, (width, height) = scene.train[0].camera.K, scene.train[0].full_size()
    lens = Lens(
        "OPENCV", (K_given[0, 0] * 0.98, K_given[1, 1] * 0.98, *K_given[:2, 2], 0.12, -0.05, 0, 0), (width, height)
    )
    frame = with_lens(scene, lens).train[0]
    x, y = np.meshgrid(np.arange(frame.camera.width) + 0.5, np.arange(frame.camera.height) + 0.5)
    column, row = (
        (one - frame.camera.K[axis, 2]) / frame.camera.K[axis, axis] * K_given[axis, axis] + K_given[axis, 2] - 0.5
        for axis, one in enumerate((x, y))
    )
    wanted = cv2.remap(bent[frame.color_path.stem], column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)
    error = np.abs(frame.color()[8:-8, 8:-8, ::-1].astype(float) - wanted[8:-8, 8:-8])
    assert np.median(error) < 4 and error.mean() < 8
    assert pinhole_of(frame.lens).size == frame.full_size()
    small = with_lens(read_scene(scene_config(image_width=160)), lens).train[0]
    assert small.camera.width <= 160 and small.color().shape[1::-1] == small.camera.size
