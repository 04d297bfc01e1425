"""Every bad capture is refused with one sentence that names the file."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.depth.sensor.maps import sensor_depth
from room2dgs.errors import InputError


@pytest.fixture
def refused(scene_config):
    """`refused(*words, **changes)`: reading fails, and the one-line message has all the words."""

    def check(*words: str, **changes) -> None:
        with pytest.raises(InputError) as caught:
            read_scene(scene_config(**changes))
        message = str(caught.value)
        assert "\n" not in message and not message.endswith(".")
        for word in words:
            assert word in message

    return check


def test_a_folder_that_is_not_there(refused, tmp_path):
    refused("nowhere is not there", "docs/reference/captures.md", path=str(tmp_path / "nowhere"))


def test_a_file_instead_of_a_folder(refused, capture):
    refused("0.jpg", "poses are unknown", path=str(capture / "color" / "0.jpg"))


@pytest.mark.parametrize("folder", ["color", "pose", "intrinsic"])
def test_a_missing_folder(refused, capture, folder):
    shutil.rmtree(capture / folder)
    refused(f"{folder} is missing", "intrinsic/intrinsic_color.txt")


def test_no_photos_with_numbers_for_names(refused, capture):
    for path in (capture / "color").iterdir():
        path.rename(path.with_name(f"frame-{path.name}"))
    refused("color", "no photos", "<number>.jpg")


def test_the_same_frame_twice(refused, capture):
    shutil.copy(capture / "color" / "5.jpg", capture / "color" / "005.jpg")
    refused("5.jpg", "005.jpg", "same frame")


def test_a_missing_intrinsics_file(refused, capture):
    (capture / "intrinsic" / "intrinsic_color.txt").unlink()
    refused("intrinsic_color.txt is missing")


def dropped(scene_config) -> dict[str, str]:
    return {one.name: one.reason for one in read_scene(scene_config()).dropped}


def test_a_missing_pose_costs_its_photo(scene_config, capture):
    (capture / "pose" / "10.txt").unlink()
    found = dropped(scene_config)
    assert list(found) == ["000010"] and "pose/10.txt is missing" in found["000010"]


def test_no_poses_at_all(refused, capture):
    for path in (capture / "pose").iterdir():
        path.unlink()
    refused("0 usable views", "8 dropped", "pose/0.txt is missing")


def test_a_malformed_pose_costs_its_photo_and_two_of_eight_the_capture(scene_config, refused, capture):
    (capture / "pose" / "10.txt").write_text("1 2 3")
    found = dropped(scene_config)
    assert list(found) == ["000010"] and "3 numbers" in found["000010"]
    (capture / "pose" / "15.txt").write_text("")
    refused("10.txt", "3 numbers", "first of 2")


def test_a_pose_with_scale_costs_its_photo_and_scaled_ones_the_capture(scene_config, refused, capture):
    for i in (20, 25):
        pose = np.loadtxt(capture / "pose" / f"{i}.txt")
        pose[:3, :3] *= 1000.0
        np.savetxt(capture / "pose" / f"{i}.txt", pose)
        if i == 20:
            found = dropped(scene_config)
            assert list(found) == ["000020"] and "not a rigid pose" in found["000020"]
    refused("20.txt", "not a rigid pose")


def text(path):
    path.write_text("no image")


def empty(path):
    path.write_bytes(b"")


def half(path):
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def without_its_end(path):
    path.write_bytes(path.read_bytes()[:-200])


@pytest.mark.parametrize(
    ("spoil", "word"),
    [(text, "is not an image"), (empty, "is empty"), (half, "ends too early"), (without_its_end, "ends too early")],
)
def test_a_photo_that_is_not_whole_costs_itself_and_two_of_eight_the_capture(
    scene_config, refused, capture, spoil, word
):
    spoil(capture / "color/15.jpg")
    found = dropped(scene_config)
    assert list(found) == ["000015"] and word in found["000015"]
    spoil(capture / "color/25.jpg")
    refused("color/15.jpg", word, "first of 2")


@pytest.mark.parametrize("spoil", [text, empty, half])
def test_a_depth_map_that_is_not_whole_stops_no_run(capture, scene_config, default_config, spoil):
    spoil(capture / "depth/15.png")
    frame = next(frame for frame in read_scene(scene_config()).frames if frame.name == "000015")
    with pytest.raises(InputError, match=r"depth/15\.png cannot be decoded"):
        sensor_depth(frame, default_config.prior.depth)


def test_a_truncated_png_photo(scene_config, capture, corner_views):
    path = capture / "color" / "15.png"
    (capture / "color" / "15.jpg").unlink()
    cv2.imwrite(str(path), corner_views[3][1])
    half(path)
    assert "15.png cannot be decoded" in dropped(scene_config)["000015"]


def test_one_photo_of_another_size_is_left_out_by_name(scene_config, capture):
    cv2.imwrite(str(capture / "color" / "25.jpg"), np.zeros((200, 320, 3), np.uint8))
    why = dropped(scene_config)
    assert list(why) == ["000025"]
    assert "25.jpg has 320x200 pixels" in why["000025"] and "320x240" in why["000025"]


def test_photos_of_another_size(refused, capture):
    for number in (20, 25):
        cv2.imwrite(str(capture / "color" / f"{number}.jpg"), np.zeros((200, 320, 3), np.uint8))
    refused("20.jpg", "320x200", "320x240", "the first of 2 photos")


@pytest.mark.parametrize("factor", [0.5, 2.0, 1.5])
def test_intrinsics_of_another_image_size(refused, capture, factor):
    K = np.loadtxt(capture / "intrinsic" / "intrinsic_color.txt")
    K[:2] *= factor
    np.savetxt(capture / "intrinsic" / "intrinsic_color.txt", K)
    refused("intrinsic_color.txt", "320x240", "look like those of", "scene.intrinsics=[2")


def test_intrinsics_of_the_turned_photo(refused, capture):
    K = np.loadtxt(capture / "intrinsic" / "intrinsic_color.txt")
    K[:2, 2] = K[1::-1, 2]
    np.savetxt(capture / "intrinsic" / "intrinsic_color.txt", K)
    refused("intrinsic_color.txt", "320x240")


def test_depth_of_another_shape_costs_its_photo(scene_config, refused, capture):
    cv2.imwrite(str(capture / "depth" / "5.png"), np.zeros((240, 240), np.uint16))
    why = dropped(scene_config)
    assert list(why) == ["000005"] and "5.png has 240x240 pixels" in why["000005"]
    cv2.imwrite(str(capture / "depth" / "10.png"), np.zeros((240, 240), np.uint16))
    refused("5.png", "240x240", "the first of 2 photos")


def test_depth_of_eight_bits(refused, capture):
    cv2.imwrite(str(capture / "depth" / "5.png"), np.zeros((240, 320), np.uint8))
    refused("5.png", "16-bit")


def test_depth_of_another_camera(refused, capture):
    K = np.loadtxt(capture / "intrinsic" / "intrinsic_depth.txt")
    K[0, 0] *= 1.3
    np.savetxt(capture / "intrinsic" / "intrinsic_depth.txt", K)
    refused("intrinsic_depth.txt", "register")


def test_fewer_than_three_usable_views(refused, capture):
    for i in range(2, 8):
        (capture / "pose" / f"{5 * i}.txt").write_text("-inf " * 16)
    refused("2 usable views", "6 dropped", "10.txt")


def test_a_stride_that_leaves_too_few(refused):
    refused("2 usable views", "scene.stride", stride=4)


def test_a_hold_out_that_leaves_too_few(refused):
    refused("scene.test_every=1", "0 of the 8", test_every=1)


def test_a_given_ground_truth_that_is_missing(refused, tmp_path):
    refused("absent.ply is missing", gt_mesh=str(tmp_path / "absent.ply"))


def test_photos_whose_names_are_no_numbers_are_told(scene_config, capture):
    shutil.copy(capture / "color" / "5.jpg", capture / "color" / "five.jpg")
    scene = read_scene(scene_config())
    assert len(scene.frames) == 8 and any("1 photos whose names are no numbers" in note for note in scene.notes)
