"""Projection and its inverse, rays, sizes and poses of cameras of any shape."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.camera_tensors import camera_tensors, view_matrices
from room2dgs.geometry.poses import inverse_pose, pose_at, rigid_pose


def any_camera(seed: int) -> Camera:
    """fx != fy, the principal point anywhere, even outside the image; a random pose up to 50 m from the origin."""
    random = np.random.default_rng(seed)
    width, height = (int(n) for n in random.integers(1, 60, 2))
    K = np.array([[random.uniform(5, 90), 0, 0], [0, random.uniform(5, 90), 0], [0, 0, 1]])
    K[:2, 2] = random.uniform(-0.5, 1.5, 2) * (width, height)
    rotation = Rotation.random(rng=random).as_matrix()
    return Camera(K, width, height, rigid_pose(rotation, random.uniform(-50, 50, 3)))


cameras = st.integers(0, 10_000).map(any_camera)


@given(cameras, st.integers(0, 10_000))
def test_a_pixel_and_its_depth_come_back(camera, seed):
    random = np.random.default_rng(seed)
    pixel, depth = random.uniform(-20, 80, (4, 5, 2)), random.uniform(0.1, 20, (4, 5))
    found, z = camera.project(camera.unproject(pixel, depth))
    np.testing.assert_allclose(found, pixel, rtol=0, atol=1e-9)
    np.testing.assert_allclose(z, depth, rtol=0, atol=1e-9)


@given(cameras)
def test_projection_is_that_of_the_matrices(camera):
    xyz = camera.centre + 2 * camera.forward + np.array([0.3, -0.2, 0.1])
    homogeneous = camera.K @ (camera.cam_from_world @ np.append(xyz, 1.0))[:3]
    pixel, depth = camera.project(xyz)
    assert pixel == pytest.approx(homogeneous[:2] / homogeneous[2], abs=1e-9)
    assert depth == pytest.approx(homogeneous[2])


@given(cameras)
def test_a_depth_map_becomes_the_points_whose_pixels_have_that_depth(camera):
    depth = np.random.default_rng(0).uniform(0.2, 5, (camera.height, camera.width))
    pixel, z = camera.project(camera.unproject_map(depth))
    np.testing.assert_allclose(pixel[-1, -1], (camera.width - 0.5, camera.height - 0.5), atol=1e-9)
    np.testing.assert_allclose(pixel, camera.pixels(), atol=1e-9)
    np.testing.assert_allclose(z, depth, atol=1e-9)
    assert camera.inside(pixel.round(6)).all()


@given(cameras, st.integers(1, 100), st.integers(1, 100))
def test_a_resized_camera_sees_the_same_at_the_same_share_of_its_image(camera, width, height):
    xyz = camera.unproject(np.random.default_rng(1).uniform(0, 60, (7, 2)), np.full(7, 2.0))
    small = camera.resized(width, height)
    np.testing.assert_allclose(
        small.project(xyz)[0] / small.size, camera.project(xyz)[0] / camera.size, rtol=1e-9, atol=1e-9
    )
    back = small.resized(*camera.size)
    np.testing.assert_allclose(back.K, camera.K, rtol=1e-12)
    kept = camera.resized_to_width(width)
    assert kept.width == width and abs(kept.height - camera.height * width / camera.width) <= 1


@given(cameras)
def test_poses_and_directions_turn_back(camera):
    np.testing.assert_allclose(camera.cam_from_world @ camera.world_from_cam, np.eye(4), atol=1e-9)
    np.testing.assert_allclose(inverse_pose(camera.world_from_cam), camera.cam_from_world, atol=1e-9)
    np.testing.assert_allclose(camera.to_camera(camera.centre), 0, atol=1e-9)
    np.testing.assert_allclose(pose_at(camera.rotation, camera.centre), camera.cam_from_world, atol=1e-9)
    vectors = np.random.default_rng(2).normal(size=(3, 2, 3))
    np.testing.assert_allclose(camera.turned_to_world(camera.turned_to_camera(vectors)), vectors, atol=1e-12)
    np.testing.assert_allclose(camera.turned_to_world(np.array([0, 0, 1.0])), camera.forward, atol=1e-12)
    np.testing.assert_allclose(camera.to_world(camera.to_camera(vectors)), vectors, atol=1e-9)
    np.testing.assert_allclose(
        camera.world_rays()[0, 0], camera.unproject(np.array([0.5, 0.5]), 1.0) - camera.centre, atol=1e-9
    )


def test_rays_go_through_pixel_centres(camera):
    np.testing.assert_allclose((camera.rays() @ camera.K.T)[4, 7], [7.5, 4.5, 1.0], atol=1e-12)


def test_a_point_behind_the_camera_has_no_pixel_and_is_not_in_view(camera):
    behind = camera.unproject(np.array([20.0, 20.0]), np.array(-2.0))  # its mirror image would be in the middle
    pixel, depth = camera.project(behind)
    assert np.isnan(pixel).all() and depth == pytest.approx(-2.0)
    assert not camera.inside(pixel) and not camera.in_view(behind)
    assert not camera.in_view(camera.centre)


def test_borders_and_near_plane(camera):
    pixel = np.array([[0, 0], [44.999, 37.999], [45, 20], [20, 38], [-1e-6, 20], [20, -1e-6]])
    assert camera.inside(pixel).tolist() == [True, True, False, False, False, False]
    middle = np.tile([20.0, 20.0], (2, 1))
    assert camera.in_view(camera.unproject(middle, np.array([0.049, 0.051]))).tolist() == [False, True]


def test_cameras_as_tensors_say_what_each_camera_says():
    several = [any_camera(seed) for seed in range(4)]
    tensors = camera_tensors(several)
    random = np.random.default_rng(0)
    view, other = torch.tensor([0, 1, 2, 3, 3]), torch.tensor([1, 0, 3, 2, 3])
    pixel, depth = random.uniform(0, 40, (5, 2)), random.uniform(0.5, 4, 5)
    in_cam = tensors.rays(view, torch.from_numpy(pixel).float()) * torch.from_numpy(depth).float()[:, None]
    found, _ = tensors.project(view, in_cam)
    np.testing.assert_allclose(found, pixel, atol=1e-4)
    ours, ours_z = tensors.seen_by(other, view, in_cam)
    for row in range(5):
        here, there = several[view[row]], several[other[row]]
        np.testing.assert_allclose(in_cam[row], here.rays_at(pixel[row]) * depth[row], rtol=1e-4, atol=1e-4)
        expected = there.to_camera(here.unproject(pixel[row], depth[row]))
        assert float(ours_z[row]) == pytest.approx(expected[2], rel=1e-3, abs=1e-3)
        if expected[2] > 1:
            np.testing.assert_allclose(ours[row], there.project(there.to_world(expected))[0], rtol=1e-3, atol=0.1)
    sizes = tensors.size[view]
    assert tensors.inside(view, sizes - 0.01).all() and not tensors.inside(view, sizes).any()


def test_matrices_of_a_view_are_float32(camera):
    K, cam_from_world = view_matrices(camera)
    assert K.dtype == cam_from_world.dtype == torch.float32
    np.testing.assert_allclose(K, camera.K, rtol=1e-6)
    np.testing.assert_allclose(cam_from_world, camera.cam_from_world, rtol=1e-6, atol=1e-7)


@given(cameras, st.integers(0, 10_000))
def test_points_fall_into_the_pixels_that_they_project_to(camera, seed):
    random = np.random.default_rng(seed)
    pixel = random.uniform(-20, 80, (40, 2))
    points = camera.unproject(pixel, random.uniform(-1, 3, 40))
    number, column, row, z = camera.pixels_of(points, 0.5)
    projected, depth = camera.project(points)
    assert set(number) == set(np.flatnonzero(camera.inside(projected) & (depth > 0.5)))
    assert ((column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)).all()
    off = projected[number] - np.stack([column, row], axis=1)
    assert ((off >= 0) & (off < 1)).all()
    np.testing.assert_array_equal(z, depth[number])
