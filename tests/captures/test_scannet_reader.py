"""The ScanNet layout on disk to a Scene: order, conventions, sizes, dropped frames."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.captures.read import read_scene
from room2dgs.geometry.camera import Camera

WIDTH, HEIGHT, FOCAL = 320, 240, 260.0


def project(camera: Camera, point: np.ndarray) -> np.ndarray:
    """Pixel position, 0 at the image's left and upper edge."""
    in_camera = camera.cam_from_world[:3, :3] @ point + camera.cam_from_world[:3, 3]
    return (camera.K @ in_camera / in_camera[2])[:2]


def names(frames) -> list[str]:
    return [frame.name for frame in frames]


def test_frames_come_in_numerical_order_with_the_middle_of_each_group_held_out(scene_config):
    scene = read_scene(scene_config())
    assert names(scene.frames) == [f"{5 * i:06d}" for i in range(8)]
    assert names(scene.test) == ["000010", "000030"]
    assert names(scene.train) == ["000000", "000005", "000015", "000020", "000025", "000035"]
    assert scene.dropped == () and scene.gt_mesh is None


def test_stride_comes_before_count(scene_config):
    scene = read_scene(scene_config(stride=2, frames=3, test_every=0))
    assert names(scene.train) == ["000000", "000020", "000030"]


def test_poses_are_turned_into_cam_from_world(scene_config, corner_views):
    scene = read_scene(scene_config())
    for frame, (world_from_cam, _, _) in zip(scene.frames, corner_views, strict=True):
        np.testing.assert_allclose(
            frame.camera.cam_from_world @ world_from_cam, np.eye(4), atol=1e-7
        )  # nine decimals on disk
        np.testing.assert_allclose(frame.camera.centre, world_from_cam[:3, 3], atol=1e-8)


def test_photo_and_depth_are_what_the_camera_sees(scene_config, corner_views):
    frame = read_scene(scene_config()).train[1]
    _, photo, depth = corner_views[1]
    assert np.abs(frame.color().astype(int) - photo[..., ::-1]).mean() < 4.0  # BGR drawn, RGB read
    np.testing.assert_allclose(frame.depth(), depth * 1e-3, rtol=1e-6)
    # the back-projected depth lies on the planes of the corner
    rows, columns = np.mgrid[10:230:20, 10:310:20]
    pixels = np.stack([columns + 0.5, rows + 0.5, np.ones_like(rows)], axis=-1).reshape(-1, 3)
    rays = pixels @ np.linalg.inv(frame.camera.K).T
    points = rays * frame.depth()[rows, columns].reshape(-1, 1)
    world = points @ frame.camera.world_from_cam[:3, :3].T + frame.camera.centre
    assert np.abs(world).min(axis=1).max() < 1.5e-3


@pytest.mark.parametrize(("centres", "cx", "cy"), [("integer", 160.0, 120.0), ("half", 159.5, 119.5)])
def test_pixel_centres_are_converted_once(scene_config, centres, cx, cy):
    K = read_scene(scene_config(pixel_centres=centres)).train[0].camera.K
    np.testing.assert_allclose(K, [[FOCAL, 0, cx], [0, FOCAL, cy], [0, 0, 1]])


def test_the_half_pixel_is_added_before_the_resize(scene_config):
    camera = read_scene(scene_config(image_width=160)).train[0].camera
    np.testing.assert_allclose(camera.K, [[FOCAL / 2, 0, 80.0], [0, FOCAL / 2, 60.0], [0, 0, 1]])


@pytest.mark.parametrize("width", [160, 100, 77])
def test_a_resize_keeps_every_projection(scene_config, width):
    full = read_scene(scene_config()).train[0].camera
    frame = read_scene(scene_config(image_width=width)).train[0]
    small = frame.camera
    assert small.width == width and small.height == round(width * HEIGHT / WIDTH)
    assert frame.color().shape == (small.height, small.width, 3)
    assert frame.depth().shape == (small.height, small.width)
    for point in np.random.default_rng(0).uniform(0.0, 0.8, (20, 3)):
        relative = project(full, point) / (WIDTH, HEIGHT)
        np.testing.assert_allclose(project(small, point) / (small.width, small.height), relative, atol=1e-12)


@given(st.integers(16, 2000), st.integers(16, 2000), st.floats(50, 2000), st.floats(-0.4, 0.4))
def test_resizing_a_camera_back_gives_it_back(width, height, focal, off):
    K = np.array([[focal, 0, (0.5 + off) * 640], [0, focal, (0.5 - off) * 480], [0, 0, 1]])
    camera = Camera(K, 640, 480, np.eye(4))
    np.testing.assert_allclose(camera.resized(width, height).resized(640, 480).K, K, rtol=1e-12)


def test_photos_are_never_enlarged(scene_config):
    camera = read_scene(scene_config(image_width=1000)).train[0].camera
    assert (camera.width, camera.height) == (WIDTH, HEIGHT)


@pytest.mark.parametrize("value", ["-inf", "nan"])
def test_a_frame_without_tracking_is_dropped_and_reported(capture, scene_config, value):
    (capture / "pose" / "15.txt").write_text("\n".join([" ".join([value] * 4)] * 4))
    scene = read_scene(scene_config(test_every=0))
    assert "000015" not in names(scene.frames) and len(scene.frames) == 7
    assert names(scene.dropped) == ["000015"]
    assert "15.txt" in scene.dropped[0].reason


def test_a_dropped_frame_does_not_cost_the_asked_count(capture, scene_config):
    (capture / "pose" / "0.txt").write_text("inf " * 16)
    scene = read_scene(scene_config(frames=7, test_every=0))
    assert len(scene.train) == 7


def test_depth_is_optional_for_a_frame_and_for_the_capture(capture, scene_config):
    (capture / "depth" / "0.png").unlink()
    scene = read_scene(scene_config())
    assert scene.train[0].depth() is None and scene.train[1].depth() is not None
    shutil.rmtree(capture / "depth")
    assert all(frame.depth() is None for frame in read_scene(scene_config()).frames)


def test_smaller_depth_maps_are_brought_to_the_photo(capture, scene_config, corner_views):
    K = np.eye(4)
    K[:3, :3] = [[FOCAL / 2, 0, 79.5], [0, FOCAL / 2, 59.5], [0, 0, 1]]
    np.savetxt(capture / "intrinsic" / "intrinsic_depth.txt", K)
    for i, (_, _, depth) in enumerate(corner_views):
        small = cv2.resize(depth, (160, 120), interpolation=cv2.INTER_NEAREST)
        cv2.imwrite(str(capture / "depth" / f"{5 * i}.png"), small)
    depth = read_scene(scene_config()).train[0].depth()
    assert depth.shape == (HEIGHT, WIDTH)
    assert np.median(np.abs(depth - corner_views[0][2] * 1e-3)) < 0.01


def test_an_orientation_tag_does_not_turn_the_photo(capture, scene_config):
    from PIL import Image

    for path in (capture / "color").iterdir():
        with Image.open(path) as image:
            exif = image.getexif()
            exif[0x0112] = 6  # rotated by a quarter
            image.save(path, exif=exif)
    frame = read_scene(scene_config()).train[0]
    assert frame.color().shape == (HEIGHT, WIDTH, 3)


def test_the_ground_truth_is_found_or_given(capture, scene_config, tmp_path):
    (capture / "gt_mesh.ply").write_text("ply\n")
    assert read_scene(scene_config()).gt_mesh == capture / "gt_mesh.ply"
    other = tmp_path / "other.ply"
    other.write_text("ply\n")
    assert read_scene(scene_config(gt_mesh=str(other))).gt_mesh == other
