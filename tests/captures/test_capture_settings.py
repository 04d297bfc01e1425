"""What a capture does not say, or says wrongly, and how it is told."""

from __future__ import annotations

import json
import re
import shutil
import struct
import zlib
from dataclasses import replace
from io import BytesIO

import cv2
import numpy as np
import pytest
from PIL import Image

from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.scannetpp_depth import DepthStream, lz4_block
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import describe_capture
from room2dgs.runs.page import texts

GL = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture
def refused(settings):
    """`refused(path, *words, **changes)`: reading fails with one sentence that has all the words."""

    def check(path, *words: str, **changes) -> None:
        with pytest.raises(InputError) as caught:
            read_scene(settings(path, **changes))
        message = str(caught.value)
        assert "\n" not in message
        for word in words:
            assert word in message

    return check


def test_two_layouts_in_one_folder_ask(written, refused, settings, made):
    root = written("scannet")
    (root / "transforms.json").write_text("{}")
    refused(root, "scannet and nerfstudio", "scene.layout=scannet", "scene.layout=nerfstudio")
    assert read_scene(settings(root, layout="scannet")).layout == "scannet"


def test_an_export_that_brings_its_colmap_model_is_not_ambiguous(written, settings):
    root = written("nerfstudio")
    (root / "colmap/sparse/0").mkdir(parents=True)
    (root / "colmap/sparse/0/cameras.txt").write_text("")
    assert read_scene(settings(root)).layout == "nerfstudio"


def test_photos_without_poses(tmp_path, refused, made):
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images/a.jpg"), made.photos[0])
    refused(tmp_path, "poses are unknown")
    refused(tmp_path / "images", "poses are unknown")
    (tmp_path / "walk.MP4").write_bytes(b"")
    refused(tmp_path, "walk.MP4 is a video and poses are unknown")
    refused(tmp_path / "walk.MP4", "walk.MP4 is a video and poses are unknown")


def test_a_folder_of_something_else(tmp_path, refused):
    (tmp_path / "letter.txt").write_text("Dear")
    refused(tmp_path, "no layout that is known")


@pytest.mark.parametrize(
    ("meaning", "written_as"),
    [
        ("camera_to_world_opengl", lambda pose: pose @ GL),
        ("world_to_camera_opencv", np.linalg.inv),
        ("world_to_camera_opengl", lambda pose: GL @ np.linalg.inv(pose)),
    ],
)
def test_poses_that_mean_something_else(written, settings, made, meaning, written_as):
    other = replace(made, poses=np.stack([written_as(pose) for pose in made.poses]))
    scene = read_scene(settings(written("scannet", made=other), poses=meaning))
    for frame, pose in zip(scene.frames, made.poses, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-12)


def test_poses_in_millimetres_are_named_and_mended(written, settings, made, refused):
    poses = made.poses.copy()
    poses[:, :3, 3] *= 1000
    root = written("scannet", made=replace(made, poses=poses))
    refused(root, "look like millimetres", "scene.unit=0.001")
    for frame, pose in zip(read_scene(settings(root, unit=0.001)).frames, made.poses, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-12)


@pytest.mark.parametrize("layout", ["scannet", "colmap"])
def test_poses_in_centimetres_are_told_from_millimetres_also_where_no_layout_says_metres(
    written, settings, made, refused, layout
):
    poses = made.poses.copy()
    poses[:, :3, 3] *= 700  # 7 m across in centimetres
    root = written(layout, made=replace(made, poses=poses))
    refused(root, "look like centimetres", "scene.unit=0.01")
    assert len(read_scene(settings(root, unit=0.01)).frames) == len(made.poses)


def test_points_follow_the_unit(written, settings, made):
    scene = read_scene(settings(written("colmap"), unit=0.5))
    seen = np.unique(np.concatenate([index for index, _ in made.seen]))
    np.testing.assert_allclose(scene.given_points().xyz, 0.5 * made.xyz[seen], atol=1e-12)
    assert any("scene.unit=0.5" in note for note in scene.notes)


def test_a_layout_without_intrinsics_asks_for_them(written, refused):
    refused(written("open3d"), "scene.intrinsics=[fx,fy,cx,cy]", "96x72")


def test_given_intrinsics_count_as_they_are_said_to(written, settings):
    K = read_scene(settings(written("open3d"), intrinsics=[80.0, 80.0, 48.0, 36.0])).train[0].camera.K
    np.testing.assert_allclose(K, [[80, 0, 48], [0, 80, 36], [0, 0, 1]])


def test_photos_that_were_halved_after_the_model_was_made(written, settings, made):
    half = replace(made, photos=np.stack([cv2.resize(photo, (48, 36)) for photo in made.photos]))
    scene = read_scene(settings(written("colmap", made=half)))
    np.testing.assert_allclose(scene.train[0].camera.K[:2], made.K[:2] / 2)
    points = scene.given_points()
    for frame in scene.train:
        point, pixel = points.tracks.of_frame(frame.name)
        assert len(point) > 100
        np.testing.assert_allclose(frame.camera.project(points.xyz[point])[0], pixel, atol=1e-3)


@pytest.mark.parametrize(("white", "hidden"), [(255, 0), (1, 0), (200, 100)])
def test_masks_of_0_and_1_say_the_same_as_those_of_0_and_255(written, settings, made, white, hidden):
    root = written("colmap")
    for photo in sorted((root / "images").rglob("*.jpg")):
        mask = np.full((made.height, made.width), white, np.uint8)
        mask[:, :20] = hidden
        place = root / "masks" / photo.relative_to(root / "images")
        place.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(f"{place}.png", mask)
    mask = read_scene(settings(root)).train[0].mask()
    assert not mask[:, :20].any() and mask[:, 20:].all()


def test_masks_of_photos_that_lie_in_the_capture_itself(written, settings, made):
    """Those in a folder beside the capture are somebody else's."""
    root = written("colmap")
    for photo in sorted((root / "images").rglob("*.jpg")):
        place = root / photo.relative_to(root / "images")
        place.parent.mkdir(parents=True, exist_ok=True)
        photo.rename(place)
        foreign = root.parent / "masks" / f"{photo.relative_to(root / 'images')}.png"
        foreign.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(foreign), np.zeros((made.height, made.width), np.uint8))
    shutil.rmtree(root / "images")
    assert read_scene(settings(root)).train[0].mask() is None
    for photo in sorted(root.rglob("*.jpg")):
        own = root / "masks" / f"{photo.relative_to(root)}.png"
        own.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(own), np.full((made.height, made.width), 255, np.uint8))
    assert read_scene(settings(root)).train[0].mask().all()


def test_photos_of_another_shape_than_their_intrinsics(written, refused, made):
    other = replace(made, photos=np.stack([cv2.resize(photo, (96, 54)) for photo in made.photos]))
    refused(written("colmap", made=other), "96x54", "96x72", "scene.intrinsics")


def test_a_capture_s_own_split_and_ground_truth(written, settings):
    root = written("scannetpp_dslr")
    scene = read_scene(settings(root))
    assert [frame.name for frame in scene.test] == ["DSC00098"]
    assert scene.gt_mesh == root / "scans/mesh_aligned_0.05.ply"
    assert [frame.name for frame in read_scene(settings(root, split="every")).test] == []
    assert read_scene(settings(root / "dslr")).gt_mesh == scene.gt_mesh


def test_two_cameras_ask(written, refused):
    root = written("scannetpp_dslr")
    (root / "iphone").mkdir()
    refused(root, "two cameras", str(root / "dslr"), str(root / "iphone"))


def test_upright_photos_among_lying_ones(written, settings, made):
    """The third photo is turned by a quarter: its K is turned with it."""
    root = written("nerfstudio")
    meta = json.loads((root / "transforms.json").read_text())
    frame = next(frame for frame in meta["frames"] if frame["file_path"].endswith("00010.png"))
    intrinsics = {key: meta.pop(key) for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")}
    for frames_own in meta["frames"]:
        frames_own.update(intrinsics)
    frame |= {"w": 72, "h": 96, "fl_x": 84.0, "fl_y": 81.0, "cx": 72 - intrinsics["cy"], "cy": intrinsics["cx"]}
    (root / "transforms.json").write_text(json.dumps(meta))
    cv2.imwrite(str(root / frame["file_path"]), cv2.rotate(made.photos[2], cv2.ROTATE_90_CLOCKWISE))
    cv2.imwrite(str(root / frame["depth_file_path"]), cv2.rotate(made.depths[2], cv2.ROTATE_90_CLOCKWISE))
    scene = read_scene(settings(root, image_width=48))
    sizes = [frame.camera.size for frame in scene.frames]
    assert sizes == [(48, 36)] * 2 + [(36, 48)] + [(48, 36)] * 3
    assert scene.frames[2].color().shape == (48, 36, 3) and scene.frames[2].depth().shape == (48, 36)
    np.testing.assert_allclose(scene.frames[2].camera.K[:2, 2], [(72 - 37.25) / 2, 46.5 / 2])


@pytest.mark.parametrize(("asked", "expected"), [({}, (48, 36)), ({"image_width": "full"}, (96, 72))])
def test_large_photos_are_worked_at_a_sensible_size_and_the_log_says_so(
    written, settings, asked, expected, monkeypatch
):
    monkeypatch.setattr("room2dgs.captures.working_size.LARGE_PX", 48)
    scene = read_scene(settings(written("nerfstudio"), **asked))
    assert {frame.camera.size for frame in scene.frames} == {expected}
    assert scene.frames[0].color().shape == (expected[1], expected[0], 3)
    said = [note for note in scene.notes if "scene.image_width=full uses all pixels" in note]
    assert said == ([] if asked else ["photos of 96 px are worked at 48 px; scene.image_width=full uses all pixels"])


def test_a_fisheye_s_points_lie_where_its_undistorted_photos_show_them(written, settings, made, colmap_writer):
    """Tracks are in the photo as stored; OpenCV says where its fisheye puts them."""
    root, k = written("scannetpp_dslr"), np.array([0.05, -0.01, 0.002, 0.0])
    K, seen = made.K * [[0.6, 1, 1], [1, 0.6, 1], [1, 1, 1]], []
    for index, _ in made.seen:
        pose = np.linalg.inv(made.poses[len(seen)])
        at = made.xyz[index] @ pose[:3, :3].T + pose[:3, 3]
        pixel = cv2.fisheye.projectPoints(at[:, None], np.zeros(3), np.zeros(3), K, k)[0][:, 0]
        seen.append((index, pixel))
    names = [f"DSC{i + 98:05d}.JPG" for i in range(len(made.poses))]
    numbers = " ".join(f"{value:.17g}" for value in (K[0, 0], K[1, 1], K[0, 2], K[1, 2], *k))
    colmap_writer(root / "dslr/colmap", replace(made, seen=seen), names, f"OPENCV_FISHEYE 96 72 {numbers}")
    scene = read_scene(settings(root))
    points = scene.given_points()
    for frame in scene.train:
        point, pixel = points.tracks.of_frame(frame.name)
        assert len(point) > 100
        assert np.abs(frame.camera.project(points.xyz[point])[0] - pixel).max() < 1e-3
        assert frame.color().shape[:2] == frame.mask().shape == (frame.camera.height, frame.camera.width)
    assert any("OPENCV_FISHEYE" in note for note in scene.notes)


def test_a_lost_frame_of_a_sens_is_left_out(written, settings, made):
    poses = made.poses.copy()
    poses[2] = -np.inf
    scene = read_scene(settings(written("sens", made=replace(made, poses=poses))))
    assert [dropped.name for dropped in scene.dropped] == ["000002"] and len(scene.frames) == 5


def with_exif(photo: np.ndarray, millimetres: float) -> bytes:
    """A JPEG that says a focal length as of 35 mm film."""
    exif, buffer = Image.Exif(), BytesIO()
    exif.get_ifd(0x8769)[0xA405] = millimetres
    Image.fromarray(photo[..., ::-1]).save(buffer, "jpeg", exif=exif)
    return buffer.getvalue()


def test_intrinsics_that_disagree_with_exif_are_a_warning_with_what_mends_them(written, settings, made, tmp_path):
    """81 px across 96 are 29 mm; EXIF is often wrong, so nothing stops."""
    photos = [with_exif(photo, 50) for photo in made.photos]
    root = written("colmap", made=replace(made, jpegs=tuple(photos)))
    scene = read_scene(settings(root))
    (said,) = scene.warnings
    assert "81 px" in said and "EXIF of IMG_" in said and "about 139 px" in said
    given = re.search(r"scene\.intrinsics=(\[.*\])", said)[1]
    assert read_scene(settings(root, intrinsics=json.loads(given))).warnings == ()
    log = []
    describe_capture(scene, RunFolder(tmp_path, log.append))
    assert f"WARNING: {said}" in log
    assert json.loads((tmp_path / "metrics.json").read_text())["capture"]["warnings"] == [said]
    assert said in texts.warnings(scene, load_config([f"scene.path={root}", "out=unused"]), {}, log)
    assert texts.warnings(scene, load_config([f"scene.path={root}", "out=unused"]), {}, log).count(said) == 1


@pytest.mark.parametrize(("millimetres", "odd"), [(29, 29), (29, 90), (0, 0)])
def test_exif_that_agrees_or_is_odd_in_one_photo_or_missing_is_no_warning(written, settings, made, millimetres, odd):
    photos = [with_exif(photo, odd if i == 0 else millimetres) for i, photo in enumerate(made.photos)]
    assert read_scene(settings(written("colmap", made=replace(made, jpegs=tuple(photos))))).warnings == ()


def test_photos_without_a_pose_are_left_out_by_name_in_log_and_metrics(written, settings, made, tmp_path):
    poses = made.poses.copy()
    poses[2] = -np.inf
    log = []
    describe_capture(
        read_scene(settings(written("scannet", made=replace(made, poses=poses)))), RunFolder(tmp_path, log.append)
    )
    reason = "pose/4.txt holds inf or NaN (tracking lost)"
    assert f"frame 000004 left out: {reason}" in log
    assert json.loads((tmp_path / "metrics.json").read_text())["capture"]["left_out"] == {"000004": reason}


def lz4_literals(data: bytes) -> bytes:
    """An LZ4 block of literals alone."""
    length = len(data) - 15
    return bytes([0xF0]) + b"\xff" * (length // 255) + bytes([length % 255]) + data


def test_depth_bin_of_scannetpp_in_all_of_its_packings(tmp_path):
    metres = np.random.default_rng(0).uniform(0.3, 5.0, (4, 192, 256)).astype("<f4")
    packer = zlib.compressobj(wbits=-15)
    (tmp_path / "whole.bin").write_bytes(packer.compress(metres.tobytes()) + packer.flush())
    frames = []
    for depth in metres:
        packer = zlib.compressobj(wbits=-15)
        frames.append(packer.compress(depth.tobytes()) + packer.flush())
    (tmp_path / "frames.bin").write_bytes(b"".join(struct.pack("<I", len(frame)) + frame for frame in frames))
    blocks = [lz4_literals((depth * 1000).round().astype("<u2").tobytes()) for depth in metres]
    (tmp_path / "lz4.bin").write_bytes(b"".join(struct.pack("<I", len(block)) + block for block in blocks))
    for name, exact in (("whole", 0), ("frames", 0), ("lz4", 6e-4)):
        stream = DepthStream(tmp_path / f"{name}.bin")
        for index in (0, 2, 3, 1):
            np.testing.assert_allclose(stream.frame(index), metres[index], atol=exact)
        with pytest.raises(InputError, match="frame 4"):
            stream.frame(4)


def test_lz4_matches_repeat_what_came_before():
    # "abc" as literals, then a match of 4 + 5 bytes from 3 back, then the last literals "xy"
    assert lz4_block(bytes([0x35]) + b"abc" + b"\x03\x00" + bytes([0x20]) + b"xy", 14) == b"abcabcabcabcxy"
    assert lz4_block(bytes([0x35]) + b"abc" + b"\x09\x00", 12) is None  # from before its beginning
