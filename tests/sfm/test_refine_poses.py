"""Poses that are a little off come back; good ones stay; scale and frame are those of the given poses."""

from __future__ import annotations

import subprocess
import sys
import types
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.captures.point_cloud import Tracks
from room2dgs.captures.poses_file import read_poses, with_cameras, write_poses
from room2dgs.captures.read import read_scene
from room2dgs.config import SfmConfig
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import pose_at
from room2dgs.sfm import refinement
from room2dgs.sfm.adjust import adjusted
from room2dgs.sfm.bundle import Spread, aligned, angles_deg, far_points, moves, rotation_prior_camera
from room2dgs.sfm.feature_tracks import covering
from room2dgs.sfm.matching import Matches, of_photos
from room2dgs.sfm.refinement import PoseReport, _lines, dispensable, judged, propagated_to_unplaced, refined_poses
from room2dgs.sfm.sparse import sparse_points
from room2dgs.sfm.structure import parallax_deg, reprojection_errors, triangulated

AUTO, FORCED, OFF = SfmConfig("auto", True, True), SfmConfig(True, True, True), SfmConfig(False, True, True)
KEEPING = SfmConfig("auto", False, True)
K = np.array([[260.0, 0, 160], [0, 255.0, 118], [0, 0, 1]])


def quiet(line: str) -> None:
    """Takes a log line and drops it."""


def ring(count: int = 60) -> list[Camera]:
    """Cameras on a circle of 2 m, some higher than others, that look inwards past the middle."""
    cameras = []
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        centre = np.array([2 * np.cos(angle), 2 * np.sin(angle), 0.4 * np.sin(3 * angle)])
        forward = np.array([0.3, -0.2, 0.1]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        cameras.append(Camera(K, 320, 240, pose_at(np.stack([right, np.cross(forward, right), forward]), centre)))
    return cameras


def shaken(cameras, degrees: float, metres: float, seed: int = 0) -> list[Camera]:
    """Each turned and shifted at random; root mean squares."""
    random = np.random.default_rng(seed)
    turn = np.radians(degrees) * random.normal(size=(len(cameras), 3)) / np.sqrt(3)
    shift = metres * random.normal(size=(len(cameras), 3)) / np.sqrt(3)
    return [
        replace(
            camera, cam_from_world=pose_at(Rotation.from_rotvec(t).as_matrix() @ camera.rotation, camera.centre + s)
        )
        for camera, t, s in zip(cameras, turn, shift, strict=True)
    ]


def along_a_wall(count: int = 40) -> list[Camera]:
    """Cameras on a path 3 m from a wall, turned a little this way and that."""
    cameras = []
    for index, x in enumerate(np.linspace(0, 4, count)):
        centre = np.array([x, 0.15 * np.sin(2 * x), 0.3 * np.cos(3 * x)])
        forward = np.array([x + 0.3 * np.sin(1.3 * index), 0, 3.0]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross((0.0, 1.0, 0.0), forward)
        right /= np.linalg.norm(right)
        cameras.append(Camera(K, 320, 240, pose_at(np.stack([right, np.cross(forward, right), forward]), centre)))
    return cameras


def seen(
    cameras, count: int = 500, noise_px: float = 0.3, wrong: float = 0.03, box=((-1, -1, -1), (1, 1, 1))
) -> Tracks:
    """What the cameras see of points in a box; some observations are elsewhere altogether."""
    random = np.random.default_rng(7)
    xyz = random.uniform(*box, (count, 3))
    rows = []
    for index, camera in enumerate(cameras):
        pixel, _ = camera.project(xyz)
        for point in np.flatnonzero(camera.in_view(xyz) & (random.random(count) < 0.25)):
            off = random.normal(0, noise_px, 2) if random.random() > wrong else random.uniform(-40, 40, 2)
            rows.append((point, index, *(pixel[point] + off)))
    table = np.array(sorted(rows))
    names = tuple(f"{index:06d}" for index in range(len(cameras)))
    _, point = np.unique(table[:, 0], return_inverse=True)
    return Tracks(names, table[:, 1].astype(np.int32), point.astype(np.int32), table[:, 2:].astype(np.float32))


def scale_of(cameras, true) -> float:
    """Of the centres about their mean, against the true ones."""
    found_centres, want = (np.stack([camera.centre for camera in some]) for some in (cameras, true))
    found_centres, want = found_centres - found_centres.mean(axis=0), want - want.mean(axis=0)
    return float((found_centres * want).sum() / (want * want).sum())


@pytest.mark.parametrize("degrees, metres", [(0.5, 0.01), (1.0, 0.02)])
def test_shaken_poses_come_back_in_the_given_frame_and_scale(degrees, metres):
    true = ring()
    given = shaken(true, degrees, metres)
    found, known, _ = adjusted(given, seen(true))
    assert known.all()
    before, after = moves(given, true), moves(found, true)
    assert np.median(after[0]) < 0.4 * np.median(before[0])
    assert np.median(after[1]) < 0.3 * np.median(before[1])
    assert after[0].max() < 0.8 * metres and after[1].max() < 0.5 * degrees
    # the frame is the given one: what is left is the mean of the given errors, not a drift
    assert abs(scale_of(found, given) - 1) < 1e-3
    # three deviations of the best estimate that such centres allow
    assert abs(scale_of(found, true) - 1) < 3 * metres / np.sqrt(3) / (2 * np.sqrt(len(true)))


def on_the_spot(count: int = 60, radius: float = 0.05) -> list[Camera]:
    """Who turns by a third of a circle with the camera at arm's length, in the middle of a room."""
    cameras = []
    for angle in np.linspace(0, 2 * np.pi / 3, count):
        centre = np.array([radius * np.cos(angle), radius * np.sin(angle), 0.02 * np.sin(8 * angle)])
        to = 0.8 + 0.7 * angle / 2
        forward = np.array([np.cos(to), np.sin(to), 0.15 * np.sin(5 * angle)])
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        cameras.append(Camera(K, 320, 240, pose_at(np.stack([right, np.cross(forward, right), forward]), centre)))
    return cameras


def with_focal(cameras, by: float) -> list[Camera]:
    return [replace(camera, K=camera.K * np.array([[by, 1, 1], [1, by, 1], [1, 1, 1]])) for camera in cameras]


@pytest.mark.parametrize("focal", [1.0, 0.97])
def test_a_camera_that_turns_on_the_spot_keeps_the_scale_of_its_metric_poses(focal):
    """With a focal length that is off, the photos pull the centres together."""
    true = on_the_spot()
    given = with_focal(shaken(true, 0.3, 0.003), focal)
    found, known, change = adjusted(given, seen(true, 3000, noise_px=0.5, box=((-2, 1, -1.2), (2, 3, 1.2))))
    assert known.all()
    assert abs(scale_of(found, given) - 1) < 0.01
    assert (change < -0.02) == (focal != 1.0)  # what the photos alone would have made of it


def test_cameras_in_one_point_have_no_scale_that_could_be_held():
    true = on_the_spot(radius=0.0)
    true = [replace(one, cam_from_world=pose_at(one.rotation, np.zeros(3))) for one in true]
    given = shaken(true, 0.1, 0.002, seed=3)
    assert aligned(shaken(true, 0.1, 0.002, seed=4), given, np.ones(len(true), bool)).scale == 1.0


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_the_alignment_of_a_small_reach_is_not_pulled_to_a_smaller_scale_by_scatter(scale):
    true = on_the_spot()
    found = [replace(c, cam_from_world=pose_at(c.rotation, scale * c.centre)) for c in shaken(true, 0.1, 0.007)]
    back = aligned(found, true, np.ones(len(true), bool))
    assert abs(scale_of(back.cameras, true) - 1) < 0.01 and back.scale == pytest.approx(1 / scale, rel=0.1)


def test_a_scale_that_is_held_is_said():
    report = PoseReport(True, "", 1.0, 0.5, 0.5, 0.9, 0.01, 0.2, scale_change=-0.103)
    assert "10.3% smaller; the scale of the given poses is held" in _lines(report)[-1]
    assert len(_lines(replace(report, scale_change=0.004))) == 1


def test_a_move_is_in_centimetres_only_where_lengths_are_metres():
    report = PoseReport(True, "", 1.0, 0.5, 0.5, 0.9, 0.0123, 0.2)
    assert "cameras moved 1.2 cm" in _lines(report)[0]
    assert "cameras moved 0.012 of the capture's unit" in _lines(report, metres=False)[0]


def test_along_a_wall_a_wrong_rotation_is_not_kept_at_the_cost_of_the_centre():
    true = along_a_wall()
    tracks = seen(true, 900, box=((-2, -1.5, 2.9), (6, 1.5, 3.1)))  # 20 cm of depth: a turn is almost a shift
    ratios = []
    for seed in range(3):
        given = shaken(true, 0.5, 0.01, seed)
        found, known, _ = adjusted(given, tracks)
        assert known.all()
        ratios.append([np.median(moves(found, true)[k]) / np.median(moves(given, true)[k]) for k in (0, 1)])
    assert np.mean(ratios, axis=0)[0] < 0.6 and np.mean(ratios, axis=0)[1] < 0.3


@pytest.mark.parametrize("axis, most", [((1.0, 0, 0), 1.01), ((0, 1.0, 0), 1.6), ((0, 0, 1.0), 0.3)])
def test_a_turn_by_its_spread_costs_what_an_observation_of_that_noise_does(axis, most):
    spread, camera = Spread(0.01, 0.4, 0.7), ring()[5]
    prior_camera = rotation_prior_camera(spread)
    points = far_points(camera, prior_camera)
    turn = Rotation.from_rotvec(np.radians(spread.degrees) * np.array(axis)).as_matrix()
    seen_at, turned = (
        prior_camera.img_from_cam((points - camera.centre) @ (r @ camera.rotation).T) for r in (np.eye(3), turn)
    )
    cost = 2 * np.sum((turned - seen_at) ** 2) / spread.pixels**2  # each point is observed twice
    assert (0.2 if axis[2] else 0.99) < cost < most


def test_true_poses_stay_where_they_are():
    true = ring()
    found, known, _ = adjusted(true, seen(true, noise_px=0.1))
    metres, degrees = moves(found, true)
    assert known.all() and metres.max() < 1e-3 and degrees.max() < 0.02


def test_a_camera_without_tracks_keeps_its_pose():
    true = ring()
    given = shaken(true, 0.5, 0.01)
    tracks = seen(true)
    few = ~((tracks.frame == 7) & (np.arange(len(tracks)) % 40 > 0))
    _, point = np.unique(tracks.point[few], return_inverse=True)
    found, known, _ = adjusted(
        given, Tracks(tracks.frames, tracks.frame[few], point.astype(np.int32), tracks.pixel[few])
    )
    assert not known[7] and known.sum() == len(true) - 1
    np.testing.assert_array_equal(found[7].cam_from_world, given[7].cam_from_world)
    assert np.median(moves(found, true)[0]) < 0.004


def test_nothing_to_see_leaves_everything():
    true = ring(6)
    nobody = np.zeros(0, np.int32)
    found, known, _ = adjusted(true, Tracks(("a",) * 6, nobody, nobody, np.zeros((0, 2), np.float32)))
    assert not known.any() and moves(found, true)[0].max() == 0


def test_alignment_undoes_a_similarity_and_overlooks_a_camera_that_jumped():
    true = ring(20)
    turn = Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix()
    other = [
        replace(c, cam_from_world=pose_at(c.rotation @ turn.T, 1.05 * turn @ c.centre + [0.2, 0.1, -0.3])) for c in true
    ]
    jumped = list(other)
    jumped[3] = replace(other[3], cam_from_world=pose_at(other[3].rotation, other[3].centre + np.array([1.0, 0, 0])))
    which = np.arange(20) != 5
    back = aligned(jumped, true, which).cameras
    metres, degrees = moves(back, true)
    rest = which & (np.arange(20) != 3)
    assert metres[rest].max() < 1e-6 and degrees[rest].max() < 1e-5
    assert metres[3] == pytest.approx(1 / 1.05, rel=1e-5)
    np.testing.assert_array_equal(back[5].cam_from_world, other[5].cam_from_world)


def test_angles_are_exact_from_tiny_to_half_a_turn():
    for degrees in (1e-7, 1e-3, 1.0, 90.0, 179.9):
        turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0, 0.8])).as_matrix()
        assert angles_deg(turn[None], np.eye(3))[0] == pytest.approx(degrees, rel=1e-6)


def test_triangulation_finds_points_despite_a_wrong_observation():
    cameras = ring(12)
    xyz = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    frame, point = np.tile(np.arange(12, dtype=np.int32), 20), np.repeat(np.arange(20, dtype=np.int32), 12)
    pixel = np.stack([cameras[f].project(xyz[p])[0] for f, p in zip(frame, point, strict=True)])
    pixel[5] += 30
    tracks = Tracks(tuple(map(str, range(12))), frame, point, pixel.astype(np.float32))
    found = triangulated(cameras, tracks)
    np.testing.assert_allclose(found, xyz, atol=2e-3)
    error = reprojection_errors(cameras, found, tracks)
    assert error[5] > 25 and np.median(error) < 1e-3
    assert parallax_deg(cameras, found, tracks).min() > 90


def test_points_behind_a_camera_and_rays_side_by_side_are_none():
    cameras = ring(3)
    same = [cameras[0]] * 3
    pixel = np.full((3, 2), 100, np.float32)
    tracks = Tracks(("a", "b", "c"), np.arange(3, dtype=np.int32), np.zeros(3, np.int32), pixel)
    assert np.isnan(triangulated(same, tracks)).all()
    assert np.isinf(reprojection_errors(same, triangulated(same, tracks), tracks)).all()


def test_the_longest_tracks_are_chosen_until_every_photo_has_enough():
    frame = np.array([0, 1, 2, 3, 0, 1, 2, 1, 2, 3], np.int32)
    point = np.array([0, 0, 0, 0, 1, 1, 1, 2, 2, 2], np.int32)
    tracks = Tracks(("a", "b", "c", "d"), frame, point, np.zeros((10, 2), np.float32))
    np.testing.assert_array_equal(covering(tracks, 1), [True, False, False])
    np.testing.assert_array_equal(covering(tracks, 2), [True, True, True])


class NoMatches:
    """In place of matches where only tracks are judged."""

    of_pair = types.MappingProxyType({})


def test_better_poses_are_taken_good_ones_kept_and_few_tracks_named():
    true = ring()
    tracks = seen(true)
    given = shaken(true, 0.5, 0.01)
    found, report = judged(given, tracks, NoMatches, [], forced=False)
    assert report.refined and report.after_px < 0.5 and report.before_px > 1.0 and not report.left
    assert moves(found, true)[0].max() < 0.01
    assert report.moved_m == pytest.approx(np.median(moves(found, given)[0]), rel=1e-9)
    found, report = judged(true, tracks, NoMatches, [], forced=False)
    assert not report.refined and found == true
    few = tracks.point < 50
    some = Tracks(tracks.frames, tracks.frame[few], tracks.point[few], tracks.pixel[few])
    found, report = judged(given, some, NoMatches, [], forced=True)
    assert not report.refined and found == given and report.why == "only 50 tracks through 3 photos or more"


def test_poses_stay_where_photos_tell_those_of_few_views_only():
    """On a bare floor a quarter of the views would be moved, and the others left out as what does not fit them."""
    true = ring()
    given, tracks = shaken(true, 0.5, 0.01), seen(true)
    few = tracks.frame < 15
    _, point = np.unique(tracks.point[few], return_inverse=True)
    some = Tracks(tracks.frames, tracks.frame[few], point.astype(np.int32), tracks.pixel[few])
    found, report = judged(given, some, NoMatches, [], forced=False)
    assert not report.refined and found == given and report.why == "only 15 of 60 photos have tracks enough"
    assert not report.left
    forced, report = judged(given, some, NoMatches, [], forced=True)
    assert report.refined and moves(forced[:15], true[:15])[0].max() < 0.02


def test_a_camera_that_jumps_is_left_and_named():
    true = ring()
    given = shaken(true, 0.2, 0.005)
    given[11] = replace(
        given[11], cam_from_world=pose_at(given[11].rotation, given[11].centre + np.array([0, 0, 0.15]))
    )
    found, report = judged(given, seen(true), NoMatches, [], forced=False)
    assert report.refined and report.left == ("000011",)
    np.testing.assert_array_equal(found[11].cam_from_world, given[11].cam_from_world)
    assert np.delete(moves(found, true)[0], 11).max() < 0.008


def shake_capture(capture, degrees: float, metres: float) -> dict[str, np.ndarray]:
    """Shakes the poses on disk; gives the true ones by file name."""
    random = np.random.default_rng(5)
    true = {}
    for path in sorted((capture / "pose").iterdir()):
        pose = true[path.stem] = np.loadtxt(path)
        turn = np.radians(degrees) * random.normal(size=3) / np.sqrt(3)
        shaken = pose.copy()
        shaken[:3, :3] = Rotation.from_rotvec(turn).as_matrix() @ pose[:3, :3]
        shaken[:3, 3] += metres * random.normal(size=3) / np.sqrt(3)
        np.savetxt(path, shaken, fmt="%.12f")
    return true


def off(frames, true) -> tuple[float, float]:
    """Largest errors in metres and degrees after the best similarity: few photos do not tell the frame."""
    want = [replace(f.camera, cam_from_world=np.linalg.inv(true[str(int(f.name))])) for f in frames]
    metres, degrees = moves(aligned([f.camera for f in frames], want, np.ones(len(frames), bool)).cameras, want)
    return float(metres.max()), float(degrees.max())


def test_photos_of_a_shaken_capture_tell_their_poses_held_out_ones_too(capture, scene_config, points_config, tmp_path):
    true = shake_capture(capture, 0.7, 0.012)
    scene = read_scene(scene_config())
    log = []
    found, report = refined_poses(scene, AUTO, points_config, tmp_path / "cache", log.append)
    assert report["refined"] and report["left"] == [] and report["after_px"] < 0.4
    assert any(line.startswith("poses refined: reprojection error ") for line in log)
    assert [frame.name for frame in found.frames] == [frame.name for frame in scene.frames]
    before, after = off(scene.frames, true), off(found.frames, true)
    assert before[0] > 0.008 and before[1] > 0.4
    assert after[0] < 0.5 * before[0] and after[1] < 0.25 * before[1]
    points = sparse_points(found, points_config, tmp_path / "cache", log.append)
    assert sum("matching" in line for line in log) == 1  # the points came with the poses
    alone = sparse_points(found, points_config, tmp_path / "other", quiet)
    np.testing.assert_array_equal(points.xyz, alone.xyz)
    np.testing.assert_array_equal(points.tracks.pixel, alone.tracks.pixel)


def test_training_poses_know_nothing_of_held_out_photos(capture, scene_config, points_config, tmp_path):
    shake_capture(capture, 0.7, 0.012)
    scene = read_scene(scene_config())
    found, _ = refined_poses(scene, AUTO, points_config, tmp_path / "a", quiet)
    for frame in scene.test:
        cv2.imwrite(str(frame.color_path), np.zeros((240, 320, 3), np.uint8))
    log = []
    black, report = refined_poses(read_scene(scene_config()), AUTO, points_config, tmp_path / "b", log.append)
    for one, other in zip(found.train, black.train, strict=True):
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    assert report["left"] == [frame.name for frame in scene.test]
    assert log[-1].startswith("views left out, ") and log[-1].endswith(f": {', '.join(report['left'])}")
    assert black.test == ()
    log = []
    kept, report = refined_poses(read_scene(scene_config()), KEEPING, points_config, tmp_path / "c", log.append)
    assert log[-1].startswith("views left at their given poses, ") and report["left_out"] == []
    for given, left in zip(scene.test, kept.test, strict=True):
        np.testing.assert_array_equal(given.camera.cam_from_world, left.camera.cam_from_world)


def test_a_view_without_a_pose_takes_no_part_unless_it_is_kept(
    capture, scene_config, points_config, tmp_path, monkeypatch
):
    shake_capture(capture, 0.7, 0.012)
    name = read_scene(scene_config()).train[2].name
    cv2.imwrite(str(read_scene(scene_config()).train[2].color_path), np.zeros((240, 320, 3), np.uint8))
    scene = read_scene(scene_config())
    found, report = refined_poses(scene, AUTO, points_config, tmp_path / "cache", quiet)
    assert report["left_out"] == [name] == [one.name for one in found.dropped]
    assert [one.name for one in found.train] == [one.name for one in scene.train if one.name != name]
    log = []
    points = sparse_points(found, points_config, tmp_path / "cache", log.append)
    assert name not in points.tracks.frames and not any("matching" in line for line in log)
    alone = sparse_points(found, points_config, tmp_path / "other", quiet)
    assert abs(len(points) - len(alone)) < 0.1 * len(alone)  # which pairs are matched may differ
    write_poses(tmp_path / "poses.json", scene, found, report)
    back, _ = read_poses(tmp_path / "poses.json", scene)
    assert [one.name for one in back.frames] == [one.name for one in found.frames]
    for one, other in zip(found.frames, back.frames, strict=True):
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    kept, report = refined_poses(scene, KEEPING, points_config, tmp_path / "cache", quiet)
    assert report["left"] == [name] and report["left_out"] == [] and len(kept.train) == len(scene.train)
    monkeypatch.setattr(refinement, "HARMFUL_PX", report["before_px"] + 0.01)  # as if the given poses were good
    kept, report = refined_poses(scene, AUTO, points_config, tmp_path / "good", quiet)
    assert report["left"] == [name] and report["left_out"] == [] and len(kept.train) == len(scene.train)


def test_only_views_whose_surfaces_others_see_are_left_out():
    cameras = ring()
    cameras[3] = replace(cameras[3], cam_from_world=pose_at(np.eye(3), cameras[3].centre))  # looks at the ceiling
    frames = [types.SimpleNamespace(name=str(index), camera=camera) for index, camera in enumerate(cameras)]
    assert dispensable(types.SimpleNamespace(train=frames, frames=frames), ("3", "7")) == ("7",)
    alone = types.SimpleNamespace(train=frames[7:8], frames=frames)  # held-out views do not count
    assert dispensable(alone, ("7",)) == ()


def test_what_drifts_is_carried_over_from_training_views_alone():
    true = ring()
    off = 0.02 * np.sin(np.arange(60) / 9)
    given = [
        replace(one, cam_from_world=pose_at(one.rotation, one.centre + np.array([shift, 0, 0])))
        for one, shift in zip(true, off, strict=True)
    ]

    def scene(cameras, far: float = 0.0):
        """Every fifth view is held out; the refined ones may lie elsewhere."""
        frames = [types.SimpleNamespace(name=str(index), camera=camera) for index, camera in enumerate(cameras)]
        for one in frames[::5]:
            one.camera = replace(one.camera, cam_from_world=pose_at(one.camera.rotation, one.camera.centre + far))
        return types.SimpleNamespace(frames=frames, train=[one for one in frames if int(one.name) % 5])

    left = ("11", "25")  # of them 25 is held out
    refined = [other if str(index) in left else one for index, (one, other) in enumerate(zip(true, given, strict=True))]
    found, share = propagated_to_unplaced(scene(given), scene(refined), left)
    assert set(found) == set(left) == set(share) and max(share.values()) < 1.0
    for name in left:
        assert np.linalg.norm(found[name].centre - true[int(name)].centre) < 0.2 * abs(off).max()
    elsewhere, _ = propagated_to_unplaced(scene(given), scene(refined, far=1.0), left)
    np.testing.assert_array_equal(elsewhere["11"].cam_from_world, found["11"].cam_from_world)


def test_of_some_photos_the_matches_among_them_are_left():
    keypoints = tuple(np.full((1, 2), float(index)) for index in range(4))
    of_pair = {pair: np.array([pair]) for pair in ((0, 1), (0, 3), (1, 2), (2, 3))}
    all_of_them = Matches(("a", "b", "c", "d"), (5, 6, 7, 8), None, None, keypoints, of_pair)
    some, pairs = of_photos(all_of_them, [(0, 1), (2, 3), (0, 3), (1, 3)], [0, 2, 3])
    assert some.frames == ("a", "c", "d") and some.image_ids == (5, 7, 8) and pairs == [(1, 2), (0, 2)]
    assert [one[0, 0] for one in some.keypoints] == [0, 2, 3]
    assert {pair: tuple(match[0]) for pair, match in some.of_pair.items()} == {(0, 2): (0, 3), (1, 2): (2, 3)}


def test_good_poses_are_kept_and_the_points_with_them(scene_config, points_config, tmp_path):
    scene = read_scene(scene_config())
    log = []
    found, report = refined_poses(scene, AUTO, points_config, tmp_path / "cache", log.append)
    assert not report["refined"] and log[-1].startswith("poses kept: reprojection error 0.")
    for one, other in zip(scene.frames, found.frames, strict=True):
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    points = sparse_points(found, points_config, tmp_path / "cache", log.append)
    alone = sparse_points(scene, points_config, tmp_path / "other", quiet)
    np.testing.assert_array_equal(points.xyz, alone.xyz)


def test_a_second_call_gives_the_same_bits_without_matching(capture, scene_config, points_config, tmp_path):
    shake_capture(capture, 0.7, 0.012)
    scene = read_scene(scene_config())
    found, report = refined_poses(scene, AUTO, points_config, tmp_path / "cache", quiet)
    log = []
    again, same = refined_poses(scene, AUTO, points_config, tmp_path / "cache", log.append)
    assert same == report and not any("matching" in line for line in log)
    for one, other in zip(found.frames, again.frames, strict=True):
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    (path,) = (tmp_path / "cache").glob("poses-*.json")
    path.write_bytes(path.read_bytes()[:200])
    anew, _ = refined_poses(scene, AUTO, points_config, tmp_path / "cache", log.append)
    assert any("matching" in line for line in log)
    for one, other in zip(found.frames, anew.frames, strict=True):
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)


ON_ONE_CORE = """
import os, sys
from dataclasses import replace
from pathlib import Path
if sys.argv[3] == "one":
    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.sfm.refinement import refined_poses
config = load_config([f"scene.path={sys.argv[1]}", "out=unused", "scene.test_every=4"])
refined_poses(read_scene(config.scene), config.sfm, replace(config.points, max_features=1000), Path(sys.argv[2]))
"""


def test_poses_and_points_have_the_same_bits_on_any_number_of_cores(capture, tmp_path):
    shake_capture(capture, 0.7, 0.012)
    made = []
    for cores in ("one", "all"):
        subprocess.run([sys.executable, "-c", ON_ONE_CORE, capture, tmp_path / cores, cores], check=True)
        made.append({path.name: path.read_bytes() for path in (tmp_path / cores).iterdir()})
    assert made[0] == made[1] and len(made[0]) == 2


def test_off_and_points_from_a_file_leave_the_photos_alone(scene_config, points_config, tmp_path):
    scene = read_scene(scene_config())
    found, report = refined_poses(scene, OFF, points_config, tmp_path / "cache", quiet)
    assert found is scene and not report["refined"]
    from_file = replace(points_config, source="file", file="points.ply")
    found, report = refined_poses(scene, AUTO, from_file, tmp_path / "cache", quiet)
    assert found is scene and report["why"] == "points are given"
    assert not (tmp_path / "cache").exists()


def test_points_that_came_with_the_capture_spare_matching_and_go_with_the_old_poses(
    capture, scene_config, points_config, tmp_path
):
    points_config = replace(points_config, source="auto")
    scene = read_scene(scene_config())
    points = sparse_points(scene, points_config, tmp_path / "cache", quiet)
    with_points = replace(scene, given_points=lambda: points)
    found, report = refined_poses(with_points, AUTO, points_config, tmp_path / "none", quiet)
    assert found is with_points and report["why"] == "points are given" and not (tmp_path / "none").exists()
    shake_capture(capture, 0.7, 0.012)
    no_tracks = replace(read_scene(scene_config()), given_points=lambda: replace(points, tracks=None))
    found, report = refined_poses(no_tracks, AUTO, points_config, tmp_path / "cache", quiet)
    assert report["refined"] and found.given_points is None


def test_photos_without_texture_keep_their_poses_with_a_sentence(capture, scene_config, points_config, tmp_path):
    for path in (capture / "color").iterdir():
        cv2.imwrite(str(path), np.full((240, 320, 3), 200, np.uint8))
    log = []
    _, report = refined_poses(read_scene(scene_config()), FORCED, points_config, tmp_path / "cache", log.append)
    assert not report["refined"]
    assert log[-1] == "poses kept: only 0 tracks through 3 photos or more"


def test_a_poses_file_gives_the_same_bits_back(scene_config, tmp_path):
    scene = read_scene(scene_config())
    cameras = {f.name: c for f, c in zip(scene.frames, shaken([f.camera for f in scene.frames], 1, 0.02), strict=True)}
    refined = with_cameras(scene, cameras)
    write_poses(tmp_path / "poses.json", scene, refined, {"refined": True})
    back, report = read_poses(tmp_path / "poses.json", scene)
    assert report == {"refined": True}
    for one, other in zip(refined.frames, back.frames, strict=True):
        np.testing.assert_array_equal(one.camera.cam_from_world, other.camera.cam_from_world)
    with pytest.raises(InputError, match=r"made for another pose of 000000 than .*capture has now"):
        read_poses(tmp_path / "poses.json", refined)


@pytest.mark.parametrize("damage", ["", "{}", '{"kind": "room2dgs poses", "report": {}, "cam_from_world": {"0": 1}}'])
def test_a_damaged_poses_file_is_named(scene_config, tmp_path, damage):
    path = tmp_path / "poses.json"
    path.write_text(damage)
    with pytest.raises(InputError, match=r"poses\.json is not a file of refined poses"):
        read_poses(path, read_scene(scene_config()))
