"""Points and normals of depth maps whose exact answer is known."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C
from room2dgs.geometry.depth_maps import depth_normals, depth_to_normals, depth_to_points, normals_by_differences


def plane_depth(camera, normal_cam, distance):
    """z-depth of the plane n . X = distance (camera frame) at every pixel's centre, float64."""
    return torch.from_numpy(distance / (camera.rays() @ normal_cam))


NORMAL_CAM = np.array([0.35, -0.25, -1.0]) / np.linalg.norm([0.35, -0.25, -1.0])


def test_points_project_back_to_their_pixels(camera):
    depth = plane_depth(camera, NORMAL_CAM, -2.0)
    points = depth_to_points(depth, camera.K, camera.cam_from_world).numpy()
    assert points == pytest.approx(camera.unproject_map(depth.numpy()))
    in_camera = camera.to_camera(points)
    pixels = in_camera @ camera.K.T
    assert in_camera[..., 2] == pytest.approx(depth.numpy())
    assert pixels[3, 7, :2] / pixels[3, 7, 2] == pytest.approx([7.5, 3.5])
    assert in_camera @ NORMAL_CAM == pytest.approx(np.full(depth.shape, -2.0))
    assert depth_to_points(depth, camera.K).numpy() == pytest.approx(in_camera)


@pytest.mark.parametrize("dtype, tolerance", [(torch.float64, 1e-12), (torch.float32, 5e-6)])
def test_a_tilted_plane_has_its_own_normal_at_every_pixel(camera, dtype, tolerance):
    # Half a pixel's mistake in the back-projection turns this plane's normals by 4.8e-4.
    depth = plane_depth(camera, NORMAL_CAM, -2.0).to(dtype)
    normal = depth_to_normals(depth, camera.K, camera.cam_from_world)
    world = camera.cam_from_world[:3, :3].T @ NORMAL_CAM
    assert np.abs(normal[1:-1, 1:-1].double().numpy() - world).max() < tolerance
    border = torch.ones(depth.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    assert (normal[border] == 0).all()

    shifted = camera.K.copy()
    shifted[:2, 2] += 0.5  # as if pixel centres were integers
    wrong = depth_to_normals(depth, shifted, camera.cam_from_world)
    assert np.abs(wrong[1:-1, 1:-1].double().numpy() - world).max() > 4e-4


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), height=st.integers(1, 20), width=st.integers(1, 27))
def test_kernel_equals_the_reference_and_faces_the_camera(seed, height, width):
    generator = np.random.default_rng(seed)
    depth = torch.from_numpy(generator.uniform(0.3, 6.0, (height, width)).astype(np.float32))
    depth[torch.from_numpy(generator.random((height, width)) < 0.05)] = 0
    K = np.array([[width * 0.9, 0, width * 0.4], [0, width * 1.1, height * 0.6], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    pose[:3, :3] *= np.linalg.det(pose[:3, :3])
    normal = depth_to_normals(depth, K, pose)
    wanted, valid = normals_by_differences(depth.double(), K, pose)
    assert (normal - wanted).abs().max() < 2e-6
    assert torch.equal(normal.abs().sum(-1) > 0, valid)
    towards = depth_to_points(depth.double(), K, pose) - torch.from_numpy(-pose[:3, :3].T @ pose[:3, 3])
    assert ((normal * towards).sum(-1)[valid] < 0).all()


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_an_invalid_depth_takes_five_normals_away_and_no_more(camera, bad):
    depth = plane_depth(camera, NORMAL_CAM, -2.0).float()
    before = depth_to_normals(depth, camera.K, camera.cam_from_world)
    depth[10, 16] = bad
    after = depth_to_normals(depth, camera.K, camera.cam_from_world)
    gone = [(9, 16), (10, 15), (10, 16), (10, 17), (11, 16)]
    assert {tuple(p) for p in (after != before).any(-1).nonzero().tolist()} == set(gone)
    assert all((after[p] == 0).all() for p in gone)
    assert torch.equal(normals_by_differences(depth.double(), camera.K, camera.cam_from_world)[1], (after != 0).any(-1))


def test_a_gradient_is_cached_when_one_is_wanted(camera):
    depth = plane_depth(camera, NORMAL_CAM, -2.0).float().requires_grad_()
    depth_to_normals(depth, camera.K, camera.cam_from_world).sum().backward()
    assert depth.grad.abs().max() > 0


def test_same_bits_on_any_number_of_threads(camera):
    depth = plane_depth(camera, NORMAL_CAM, -2.0).float()
    before = _C.threads()
    results = []
    for count in (1, 2):
        _C.set_threads(count)
        results.append(depth_to_normals(depth, camera.K, camera.cam_from_world))
    _C.set_threads(before)
    assert torch.equal(*results)


@pytest.mark.parametrize("step", [1, 3])
def test_any_step_gives_a_planes_normal_in_the_camera_frame(camera, step):
    normal = depth_normals(plane_depth(camera, NORMAL_CAM, -2.0).numpy(), camera, step)
    assert np.abs(normal[step:-step, step:-step] - NORMAL_CAM).max() < 1e-12
    known = normal.any(axis=-1)
    assert known.sum() == (camera.height - 2 * step) * (camera.width - 2 * step)


def test_neighbours_on_another_surface_take_the_normal_away(camera):
    depth = np.full((camera.height, camera.width), 2.0)
    depth[:, 20:] = 2.3
    known = depth_normals(depth, camera, step=2, max_jump=0.1).any(axis=-1)[2:-2, 2:-2]
    assert known.sum(axis=0).tolist() == [0 if column in (18, 19, 20, 21) else 34 for column in range(2, 43)]
    assert depth_normals(depth, camera, step=2, max_jump=0.2).any(axis=-1)[2:-2, 2:-2].all()


def test_a_map_smaller_than_the_step_has_no_normals(camera):
    small = camera.resized(4, 30)
    assert not depth_normals(np.ones((30, 4)), small, step=2).any()
