"""Triangulated points of a corner that the test drew, their cache, and point files."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh
from safetensors.numpy import save_file

from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.point_files import load_points, save_points
from room2dgs.captures.read import read_scene
from room2dgs.colmap import pycolmap
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.matching import epipolar_error
from room2dgs.sfm.readings import better_focal, intrinsics_setting
from room2dgs.sfm.sparse import sparse_points


def quiet(line: str) -> None:
    """Takes a log line and drops it."""


def equal(first: PointCloud, second: PointCloud) -> bool:
    parts = [(first.xyz, second.xyz), (first.rgb, second.rgb), (first.tracks.frames, second.tracks.frames)]
    parts += [(getattr(first.tracks, name), getattr(second.tracks, name)) for name in ("frame", "point", "pixel")]
    return all(np.array_equal(a, b) for a, b in parts)


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory) -> Path:
    """Filled by the first test that asks for the untouched capture's points."""
    return tmp_path_factory.mktemp("shared") / "cache"


def test_points_lie_on_the_planes_that_were_drawn(scene_config, points_config, shared_cache):
    points = sparse_points(read_scene(scene_config()), points_config, shared_cache, quiet)
    distance = np.abs(points.xyz).min(axis=1)
    assert len(points) > 300
    assert np.median(distance) < 0.003 and np.quantile(distance, 0.95) < 0.02
    assert (np.abs(points.xyz).argmin(axis=1)[:, None] == np.arange(3)).mean(axis=0).min() > 0.05  # on all three
    assert points.track_length.min() >= points_config.min_track
    assert points.track_length.max() <= 6
    assert points.rgb.std() > 10


def test_photos_whose_names_have_spaces_are_matched_as_others_are(scene_config, points_config, shared_cache, tmp_path):
    """COLMAP's list of pairs is parted by spaces."""
    scene = read_scene(scene_config())
    plain = sparse_points(scene, points_config, shared_cache, quiet)
    spaced = replace(scene, train=tuple(replace(frame, name=f"IMG 1%{frame.name} #") for frame in scene.train))
    points = sparse_points(spaced, points_config, tmp_path / "cache", quiet)
    np.testing.assert_array_equal(points.xyz, plain.xyz)
    assert points.tracks.frames == tuple(frame.name for frame in spaced.train)


def test_points_have_the_colour_of_the_photo(scene_config, points_config, shared_cache):
    scene = read_scene(scene_config())
    points = sparse_points(scene, points_config, shared_cache, quiet)
    frame = scene.train[2]
    index, pixel = points.tracks.of_frame(frame.name)
    column, row = pixel.astype(int).T
    difference = np.abs(frame.color()[row, column].astype(int) - points.rgb[index])
    assert np.median(difference) < 12


def test_tracks_say_where_each_photo_saw_its_points(scene_config, points_config, shared_cache):
    scene = read_scene(scene_config())
    points = sparse_points(scene, points_config, shared_cache, quiet)
    tracks = points.tracks
    assert tracks.frames == tuple(frame.name for frame in scene.train)
    assert len(np.unique(np.stack([tracks.frame, tracks.point]), axis=1).T) == len(tracks)  # once a photo
    off = []
    for frame in scene.train:
        index, pixel = tracks.of_frame(frame.name)
        assert len(index) > 50 and frame.camera.inside(pixel).all()
        off.append(np.linalg.norm(frame.camera.project(points.xyz[index])[0] - pixel, axis=1))
    # half a pixel's mistake in where pixels' centres are would be 0.7
    assert np.median(np.concatenate(off)) < 0.4
    shift = np.concatenate(
        [
            frame.camera.project(points.xyz[index])[0] - pixel
            for frame in scene.train
            for index, pixel in [tracks.of_frame(frame.name)]
        ]
    )
    assert np.abs(np.median(shift, axis=0)).max() < 0.1


def test_a_cache_of_points_without_tracks_is_made_again(scene_config, points_config, shared_cache):
    scene = read_scene(scene_config())
    made = sparse_points(scene, points_config, shared_cache, quiet)
    (path,) = shared_cache.iterdir()
    save_file({"xyz": made.xyz, "rgb": made.rgb, "track_length": made.track_length.astype(np.int32)}, path)
    assert equal(made, sparse_points(scene, points_config, shared_cache, quiet))
    assert equal(made, load_points(path))


@pytest.mark.parametrize("name, value", [("track_point", 10**6), ("track_frame", 6), ("track_frame", -1)])
def test_a_cache_whose_tracks_point_nowhere_is_damaged(tmp_path, name, value):
    arrays = {"frame": np.zeros(4, np.int32), "point": np.arange(4, dtype=np.int32)}
    arrays[name.removeprefix("track_")][2] = value
    tracks = Tracks(("a", "b"), **arrays, pixel=np.ones((4, 2), np.float32))
    save_points(tmp_path / "points.safetensors", PointCloud(np.eye(4)[:, :3], np.zeros((4, 3), np.uint8), tracks))
    assert load_points(tmp_path / "points.safetensors") is None


def test_a_second_call_loads_the_first_ones_result(scene_config, points_config, tmp_path):
    scene = read_scene(scene_config())
    first, second = [], []
    made = sparse_points(scene, points_config, tmp_path / "cache", first.append)
    files = list((tmp_path / "cache").iterdir())
    assert [path.suffix for path in files] == [".safetensors"]  # no database, no images left
    loaded = sparse_points(scene, points_config, tmp_path / "cache", second.append)
    assert equal(made, loaded)
    assert any("matching" in line for line in first) and not any("matching" in line for line in second)


def test_photos_are_matched_and_points_adjusted_on_one_thread_because_pycolmap_races_on_more(
    scene_config, points_config, tmp_path, monkeypatch
):
    match, triangulate, threads, residuals = pycolmap.match_image_pairs, pycolmap.triangulate_points, [], []

    def watched(database, *, matching_options, **named):
        threads.append(matching_options.num_threads)
        match(database, matching_options=matching_options, **named)

    def watched_too(*given, options):
        residuals.append(options.ba_min_num_residuals_for_cpu_multi_threading)
        return triangulate(*given, options=options)

    monkeypatch.setattr(pycolmap, "triangulate_points", watched_too)
    monkeypatch.setattr(pycolmap, "match_image_pairs", watched)
    sparse_points(read_scene(scene_config()), points_config, tmp_path / "cache", quiet)
    assert threads == [1] and residuals == [2**31 - 1]


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"\xff" * 99])
def test_a_damaged_cache_is_made_again_with_the_same_bits(scene_config, points_config, shared_cache, damage):
    scene = read_scene(scene_config())
    made = sparse_points(scene, points_config, shared_cache, quiet)
    (path,) = shared_cache.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    log = []
    assert equal(made, sparse_points(scene, points_config, shared_cache, log.append))
    assert any("matching" in line for line in log)


def test_another_photo_pose_or_setting_is_not_served_from_the_cache(
    capture, scene_config, points_config, tmp_path, monkeypatch
):
    nobody = np.zeros(0, np.int32)
    tracks = Tracks((), nobody, nobody, np.zeros((0, 2), np.float32))
    cloud = PointCloud(np.zeros((20, 3)), np.zeros((20, 3), np.uint8), tracks)
    monkeypatch.setattr("room2dgs.sfm.triangulation.triangulate", lambda *_: cloud)

    def count() -> int:
        sparse_points(read_scene(scene_config()), points_config, tmp_path / "cache", quiet)
        return len(list((tmp_path / "cache").iterdir()))

    assert count() == 1
    points_config = replace(points_config, min_track=4)
    assert count() == 2
    photo = capture / "color" / "0.jpg"
    cv2.imwrite(str(photo), cv2.imread(str(photo)), [cv2.IMWRITE_JPEG_QUALITY, 80])
    assert count() == 3
    pose = np.loadtxt(capture / "pose" / "0.txt")
    pose[0, 3] += 0.001
    np.savetxt(capture / "pose" / "0.txt", pose)
    assert count() == 4


def test_held_out_photos_leave_no_trace(scene_config, points_config, shared_cache, tmp_path):
    scene = read_scene(scene_config())
    with_it = sparse_points(scene, points_config, shared_cache, quiet)
    for frame in scene.test:
        cv2.imwrite(str(frame.color_path), np.zeros((240, 320, 3), np.uint8))
    log = []
    blackened = read_scene(scene_config())
    # in the shared cache under the same key, and the same when made afresh
    assert equal(with_it, sparse_points(blackened, points_config, shared_cache, log.append))
    assert not any("matching" in line for line in log)
    assert equal(with_it, sparse_points(blackened, points_config, tmp_path, quiet))


def test_points_come_from_photos_at_the_working_size(scene_config, points_config, tmp_path):
    points = sparse_points(read_scene(scene_config(image_width=240)), points_config, tmp_path, quiet)
    distance = np.abs(points.xyz).min(axis=1)
    assert len(points) > 100 and np.median(distance) < 0.005


GL = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("meant", "wrong"),
    [
        ("world_to_camera_opencv", np.linalg.inv),
        ("camera_to_world_opengl", lambda pose: pose @ GL),
        ("world_to_camera_opengl", lambda pose: GL @ np.linalg.inv(pose)),
    ],
)
def test_poses_of_another_convention_stop_the_run_and_are_named(
    capture, scene_config, points_config, tmp_path, meant, wrong
):
    for path in (capture / "pose").iterdir():
        np.savetxt(path, wrong(np.loadtxt(path)))
    with pytest.raises(InputError, match=rf"color and its poses do not belong together.*give scene.poses={meant}$"):
        sparse_points(read_scene(scene_config()), points_config, tmp_path / "cache", quiet)
    assert list((tmp_path / "cache").iterdir()) == []
    read_as_meant = read_scene(scene_config(poses=meant))
    points = sparse_points(read_as_meant, points_config, tmp_path / "cache", quiet)
    assert np.median(np.abs(points.xyz).min(axis=1)) < 0.005


def test_a_wrong_focal_length_is_named_with_the_right_one():
    """Cameras that look into a cloud of points each their own way; the capture says 1.37 times the focal length."""
    rng = np.random.default_rng(0)
    K = np.array([[130.0, 0, 80], [0, 130.0, 60], [0, 0, 1]])
    right = []
    for _ in range(6):
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(rng.uniform(-0.4, 0.4, 3))[0]
        pose[:3, 3] = rng.uniform(-0.8, 0.8, 3)
        right.append(Camera(K, 160, 120, pose))
    xyz = rng.uniform([-1.5, -1.2, 3.0], [1.5, 1.2, 6.0], (150, 3))
    seen = [camera.project(xyz)[0] for camera in right]
    wrong = [replace(camera, K=K * [[1.37, 1, 1], [1, 1.37, 1], [1, 1, 1]]) for camera in right]
    pairs = [(i, j) for i in range(6) for j in range(i)]
    matches = SimpleNamespace(
        of_pair={pair: np.arange(len(xyz)) for pair in pairs}, pixels=lambda pair: (seen[pair[0]], seen[pair[1]])
    )
    factor, share = better_focal(matches, wrong, pairs, 2.0)
    assert factor == pytest.approx(1 / 1.37, rel=0.02) and share > 0.95
    frame = SimpleNamespace(lens=None, camera=wrong[0], source=SimpleNamespace(size=lambda: (320, 240)))
    fx, fy, cx, cy = map(float, re.findall(r"intrinsics=\[(.*)\]", intrinsics_setting(frame, factor))[0].split(","))
    assert fx == pytest.approx(260, rel=0.02) == fy and (cx, cy) == (160, 120)
    lost = [replace(camera, cam_from_world=np.eye(4)) for camera in wrong]
    assert better_focal(matches, lost, pairs, 2.0) is None


def test_photos_from_one_place_are_named(capture, scene_config, points_config, tmp_path):
    for path in (capture / "pose").iterdir():
        pose = np.loadtxt(path)
        pose[:3, 3] = [2.0, 2.0, 1.3]
        np.savetxt(path, pose)
        photo = capture / f"color/{path.stem}.jpg"
        cv2.imwrite(str(photo), np.full((240, 320, 3), 90, np.uint8))
    with pytest.raises(InputError, match=r"was taken from one place.*0\.0 cm apart.*walk while filming"):
        sparse_points(read_scene(scene_config()), points_config, tmp_path / "cache", quiet)


def test_what_a_mask_hides_gives_no_points_and_upright_photos_do(scene_config, points_config, tmp_path):
    """The left third of one photo is masked; another one is turned by a quarter, with its camera."""
    scene = read_scene(scene_config())
    white = np.full((240, 320), 255, np.uint8)
    white[:, :107] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), white)
    path = tmp_path / "upright.png"
    frames = list(scene.train)
    cv2.imwrite(str(path), cv2.rotate(frames[2].color()[..., ::-1], cv2.ROTATE_90_CLOCKWISE))
    camera, quarter = frames[2].camera, np.eye(4)
    quarter[:2, :2] = [[0, -1], [1, 0]]
    K = np.array([[camera.K[1, 1], 0, 240 - camera.K[1, 2]], [0, camera.K[0, 0], camera.K[0, 2]], [0, 0, 1]])
    frames[1] = replace(frames[1], mask_photo=PhotoFile(tmp_path / "mask.png"))
    frames[2] = replace(frames[2], color_path=path, camera=Camera(K, 240, 320, quarter @ camera.cam_from_world))
    points = sparse_points(replace(scene, train=tuple(frames)), points_config, tmp_path / "cache", quiet)
    assert np.median(np.abs(points.xyz).min(axis=1)) < 0.003
    assert points.tracks.of_frame(frames[1].name)[1][:, 0].min() >= 107
    index, pixel = points.tracks.of_frame(frames[2].name)
    assert len(index) > 100 and pixel[:, 1].max() > 240
    assert np.median(np.linalg.norm(frames[2].camera.project(points.xyz[index])[0] - pixel, axis=1)) < 1.0


def test_a_camera_that_only_turned_is_told_so(capture, scene_config, points_config, tmp_path):
    for path in (capture / "pose").iterdir():
        pose = np.loadtxt(path)
        pose[:3, 3] = 1.0
        np.savetxt(path, pose)
    with pytest.raises(InputError, match=r"was taken from one place.*walk while filming"):
        sparse_points(read_scene(scene_config()), points_config, tmp_path / "cache", quiet)


def test_photos_without_texture_give_no_points_and_a_sentence(capture, scene_config, points_config, tmp_path):
    for path in (capture / "color").iterdir():
        cv2.imwrite(str(path), np.full((240, 320, 3), 200, np.uint8))
    with pytest.raises(InputError, match=r"capture gives 0 points.*points\.source=file"):
        sparse_points(read_scene(scene_config()), points_config, tmp_path / "cache", quiet)
    assert list((tmp_path / "cache").iterdir()) == []


def test_epipolar_error_is_zero_for_projections_and_pixels_off_the_line():
    K = np.array([[260.0, 0, 160], [0, 260.0, 120], [0, 0, 1]])
    first = Camera(K, 320, 240, np.eye(4))
    moved = np.eye(4)
    moved[0, 3] = -0.2  # to the right: epipolar lines are rows
    second = Camera(K, 320, 240, moved)
    points = np.random.default_rng(0).uniform((-0.5, -0.5, 1.0), (0.5, 0.5, 3.0), (50, 3))
    first_px = (points @ K.T)[:, :2] / points[:, 2:]
    second_px = ((points + moved[:3, 3]) @ K.T)[:, :2] / points[:, 2:]
    np.testing.assert_allclose(epipolar_error(first, second, first_px, second_px), 0.0, atol=1e-9)
    # Sampson splits a shift of 3 px between both images
    off = epipolar_error(first, second, first_px, second_px + np.array([0.0, 3.0]))
    np.testing.assert_allclose(off, 3.0 / np.sqrt(2.0), rtol=1e-9)


def write_ply(path: Path, xyz: np.ndarray, rgb: np.ndarray | None = None) -> Path:
    trimesh.PointCloud(xyz, colors=rgb).export(path)
    return path


def test_a_point_file_is_read_with_its_colours(scene_config, points_config, tmp_path):
    xyz = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32).astype(np.float64)
    rgb = np.random.default_rng(1).integers(0, 256, (40, 3), dtype=np.uint8)
    config = replace(points_config, source="file", file=str(write_ply(tmp_path / "points.ply", xyz, rgb)))
    points = sparse_points(read_scene(scene_config()), config, tmp_path / "cache", quiet)
    np.testing.assert_allclose(points.xyz, xyz, atol=1e-6)
    np.testing.assert_array_equal(points.rgb, rgb)
    assert points.tracks is None and not points.track_length.any()


def test_a_point_file_may_lack_colours_and_have_holes(scene_config, points_config, tmp_path):
    xyz = np.arange(60.0).reshape(20, 3)
    xyz[3, 1], xyz[7, 2] = np.nan, np.inf
    path = tmp_path / "points.ply"
    header = "ply\nformat ascii 1.0\nelement vertex 20\nproperty float x\nproperty float y\nproperty float z\n"
    path.write_text(header + "end_header\n" + "\n".join(" ".join(map(str, point)) for point in xyz) + "\n")
    config = replace(points_config, source="file", file=str(path))
    points = sparse_points(read_scene(scene_config()), config, tmp_path, quiet)
    np.testing.assert_array_equal(points.xyz, np.delete(xyz, [3, 7], axis=0))
    np.testing.assert_array_equal(points.rgb, 128)


def test_the_vertices_of_a_mesh_serve_too(scene_config, points_config, tmp_path):
    path = tmp_path / "mesh.ply"
    trimesh.creation.box((1.0, 2.0, 3.0)).subdivide().export(path)
    config = replace(points_config, source="file", file=str(path))
    points = sparse_points(read_scene(scene_config()), config, tmp_path, quiet)
    assert len(points) == 26 and np.abs(points.xyz).max() == pytest.approx(1.5)


def test_a_handful_of_points_is_refused(scene_config, points_config, tmp_path):
    write_ply(tmp_path / "few.ply", np.eye(3))
    config = replace(points_config, source="file", file=str(tmp_path / "few.ply"))
    with pytest.raises(InputError, match=r"few\.ply holds 3 points"):
        sparse_points(read_scene(scene_config()), config, tmp_path, quiet)


@pytest.mark.parametrize("content", [None, b"", b"no ply", b"ply\nformat ascii 1.0\nend_header\n", "nan"])
def test_an_unusable_point_file_is_refused_by_name(scene_config, points_config, tmp_path, content):
    path = tmp_path / "given.ply"
    if content == "nan":
        write_ply(path, np.full((5, 3), np.nan))
    elif content is not None:
        path.write_bytes(content)
    config = replace(points_config, source="file", file=str(path))
    with pytest.raises(InputError, match=r"given\.ply") as caught:
        sparse_points(read_scene(scene_config()), config, tmp_path, quiet)
    assert "\n" not in str(caught.value)
