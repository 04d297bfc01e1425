"""What people have in the place of a capture's own files: unpacked archives, frames of a video, undistorted photos."""

from __future__ import annotations

import json
import shutil
import zipfile

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError


def check(scene, made, depth: bool = True) -> None:
    assert len(scene.frames) == made.count
    for frame, pose, mm in zip(scene.frames, made.poses, made.depths, strict=True):
        assert np.abs(frame.camera.world_from_cam - pose).max() < 1e-9
        assert not depth or np.abs(frame.depth() - mm / 1000).max() < 1e-6


def test_an_r3d_that_was_unpacked(written, settings, made):
    pytest.importorskip("liblzfse")
    root = written("record3d_archive")
    with zipfile.ZipFile(root / "room.r3d") as archive:
        archive.extractall(root)
    (root / "room.r3d").unlink()
    check(read_scene(settings(root)), made)


def photos_of_stray(root, made, first: int) -> None:
    (root / "rgb.mp4").unlink()
    (root / "rgb").mkdir()
    for index, photo in enumerate(made.photos):
        cv2.imwrite(str(root / f"rgb/{index + first:06d}.png"), photo)


def test_photos_that_were_taken_out_of_strays_video(written, settings, made):
    root = written("stray")
    photos_of_stray(root, made, 0)
    scene = read_scene(settings(root))
    check(scene, made)
    assert np.array_equal(scene.frames[2].color()[..., ::-1], made.photos[2])


def test_photos_that_count_from_one_are_not_the_frames_of_their_numbers(written, settings, made):
    root = written("stray")
    photos_of_stray(root, made, 1)
    with pytest.raises(InputError, match=r"000001\.png to 000006\.png are as many and do not count from one number"):
        read_scene(settings(root))
    (root / "rgb/000003.png").unlink()
    with pytest.raises(InputError, match=r"rgb has 5 photos, 000001\.png to 000006\.png, which are not called by"):
        read_scene(settings(root))


def test_scannetpp_undistorted_by_its_toolkit(written, settings, made):
    root = written("scannetpp_json")
    (root / "dslr/resized_images").rename(root / "dslr/resized_undistorted_images")
    folder = root / "dslr/nerfstudio"
    (folder / "transforms.json").rename(folder / "transforms_undistorted.json")
    scene = read_scene(settings(root))
    check(scene, made, depth=False)
    assert [frame.name for frame in scene.test] == ["DSC00098"]  # test_frames


def test_a_trajectory_without_last_rows(written, settings_of, made):
    root = written("replica")
    path = root / "traj.txt"
    lines = [" ".join(line.split()[:12]) for line in path.read_text().splitlines()]
    path.write_text("\n".join(lines))
    check(read_scene(settings_of(root, "replica")), made)


def test_one_line_of_twelve_numbers_is_damaged(written, settings_of, made):
    root = written("replica")
    path = root / "traj.txt"
    lines = path.read_text().splitlines()
    lines[0] = " ".join(lines[0].split()[:12])
    path.write_text("\n".join(lines))
    scene = read_scene(settings_of(root, "replica"))
    assert [frame.name for frame in scene.frames] == [f"frame{i:06d}" for i in range(1, made.count)]


@pytest.mark.parametrize(
    ("layout", "folder"), [("stray", "."), ("arkitscenes", "41069021_frames"), ("polycam", "keyframes")]
)
def test_a_sensors_confidence_is_named(written, settings, layout, folder):
    root = written(layout)
    (root / folder / "confidence").mkdir()
    (root / folder / "confidence/000000.png").write_bytes(b"x")
    notes = " ".join(read_scene(settings(root)).notes)
    assert "confidence has 1 files that say how sure the depth is, which are not used" in notes


def test_polycam_photos_that_were_not_corrected_are_named(written, settings, made):
    root = written("polycam") / "keyframes"
    shutil.copytree(root / "corrected_images", root / "images")
    shutil.copytree(root / "corrected_cameras", root / "cameras")
    name = min(path.stem for path in (root / "images").iterdir())
    (root / f"corrected_images/{name}.jpg").unlink()
    (root / f"corrected_cameras/{name}.json").unlink()
    scene = read_scene(settings(root.parent))
    assert len(scene.frames) == made.count - 1
    assert f"1 photos of images/ are not in corrected_images/ and are not used: {name}" in " ".join(scene.notes)


def test_polycam_corrected_cameras_without_their_photos(written, settings):
    root = written("polycam")
    (root / "keyframes/corrected_images").rename(root / "keyframes/images")
    with pytest.raises(InputError, match="has keyframes/corrected_cameras and no keyframes/corrected_images"):
        read_scene(settings(root))


def test_points_on_another_machine_cost_no_photo(written, settings, made):
    root = written("nerfstudio")
    path = root / "transforms.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "ply_file_path": "D:\\x\\sparse_pc.ply"}))
    scene = read_scene(settings(root))
    check(scene, made)
    assert r"D:\x\sparse_pc.ply, a path of another machine" in " ".join(scene.notes)


def test_photos_on_another_machine_are_told(written, settings):
    root = written("nerfstudio")
    path = root / "transforms.json"
    path.write_text(path.read_text().replace('"images/', '"C:/cap/images/'))
    with pytest.raises(InputError, match=r"names C:/cap/images/frame_000\d\d.png, a path of another machine"):
        read_scene(settings(root))


@pytest.mark.parametrize("nested", [False, True])
def test_open3d_intrinsics_along_the_rows(written, settings, made, nested):
    root = written("open3d")
    K = made.K_at_integers[:3, :3]
    matrix = K.tolist() if nested else K.ravel().tolist()
    (root / "intrinsic.json").write_text(json.dumps({"width": 96, "height": 72, "intrinsic_matrix": matrix}))
    np.testing.assert_allclose(read_scene(settings(root)).frames[0].camera.K, made.K)


def test_a_matrix_that_is_no_cameras_either_way_is_refused(written, settings, made):
    root = written("open3d")
    matrix = [81.0, 0, 46, 0, 84, 36, 5, 0, 1]
    (root / "intrinsic.json").write_text(json.dumps({"width": 96, "height": 72, "intrinsic_matrix": matrix}))
    with pytest.raises(InputError, match="has intrinsic_matrix, which is no matrix of a camera"):
        read_scene(settings(root))


def test_sdfstudio_cameras_that_k_does_not_tell_are_refused(written, settings):
    root = written("sdfstudio")
    path = root / "meta_data.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "camera_model": "OPENCV_FISHEYE"}))
    with pytest.raises(InputError, match="has camera_model 'OPENCV_FISHEYE', and K alone is read"):
        read_scene(settings(root))


def test_a_sequence_that_is_still_packed_is_told(written, settings):
    root = written("sevenscenes")
    for sequence in ("seq-01", "seq-02"):
        shutil.make_archive(str(root / sequence), "zip", root / sequence)
        shutil.rmtree(root / sequence)
    with pytest.raises(InputError, match=r"has seq-01\.zip, an archive of no layout that is read in place: unpack it"):
        read_scene(settings(root))
