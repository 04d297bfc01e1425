"""Known planes in known stereo pairs; every convention's mistake is many pixels off."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from kornia.geometry.linalg import transform_points

from room2dgs.geometry.homography import plane_distance, plane_homography, relative_pose, transfer, warp_points
from room2dgs.losses.sampling import bilinear, patch_offsets, patches_at

K_R = torch.tensor([[400.0, 0, 161.3], [0, 420.0, 118.2], [0, 0, 1]], dtype=torch.float64)
K_N = torch.tensor([[380.0, 0, 150.1], [0, 370.0, 125.9], [0, 0, 1]], dtype=torch.float64)


def turned(generator, angle) -> np.ndarray:
    axis = generator.normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def stereo(seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    """reference_from_world and neighbour_from_world, 0.3 m and a few degrees apart, far from the world's origin."""
    generator = np.random.default_rng(seed)
    reference, step = np.eye(4), np.eye(4)
    reference[:3, :3], reference[:3, 3] = turned(generator, 2.0), generator.normal(size=3) * 3
    step[:3, :3] = turned(generator, 0.1)
    shift = generator.normal(size=3)
    step[:3, 3] = 0.3 * shift / np.linalg.norm(shift)
    return torch.from_numpy(reference), torch.from_numpy(step @ reference)


def on_plane(seed: int, count: int = 20):
    """A plane some 2 m before the reference camera: unit normal that faces it, pixels, rays and z-depths there."""
    generator = np.random.default_rng(seed + 1)
    normal = np.array([*generator.uniform(-0.6, 0.6, 2), -1.0])
    normal /= np.linalg.norm(normal)
    pixels = np.stack([generator.uniform(0, 320, count), generator.uniform(0, 240, count)], axis=-1)
    rays = np.concatenate([pixels, np.ones((count, 1))], axis=1) @ np.linalg.inv(K_R.numpy()).T
    depth = (normal * [0.1, -0.2, 2.0]).sum() / (rays @ normal)
    return (torch.from_numpy(a) for a in (np.broadcast_to(normal, (count, 3)).copy(), pixels, rays, depth))


def projected(points_world: torch.Tensor, pose: torch.Tensor, K: torch.Tensor) -> torch.Tensor:
    points = (points_world @ pose[:3, :3].T + pose[:3, 3]) @ K.T
    return points[:, :2] / points[:, 2:]


def mapped(homography: torch.Tensor, pixels: torch.Tensor) -> torch.Tensor:
    return torch.stack(warp_points(homography, pixels, torch.zeros(1, 2, dtype=pixels.dtype))[:2], -1)[:, 0]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_a_planes_pixels_land_where_the_neighbour_sees_them(seed):
    reference, neighbour = stereo(seed)
    normal, pixels, rays, depth = on_plane(seed)
    pose = relative_pose(reference, neighbour)
    world = (rays * depth[:, None] - reference[:3, 3]) @ reference[:3, :3]
    wanted = projected(world, neighbour, K_N)

    distance = plane_distance(normal, rays, depth)
    # the normals face the camera
    assert (distance < 0).all() and distance.std() < 1e-12
    homography = plane_homography(normal, distance, pose, K_R, K_N)
    assert (mapped(homography, pixels) - wanted).abs().max() < 1e-6
    # one plane, one homography: any of them maps all of its pixels
    assert (mapped(homography[:1].expand(len(pixels), 3, 3), pixels) - wanted).abs().max() < 1e-6
    # a plane has no side
    other_side = plane_homography(-normal, plane_distance(-normal, rays, depth), pose, K_R, K_N)
    assert (mapped(other_side, pixels) - wanted).abs().max() < 1e-6
    # points alone, there and back
    there, neighbour_depth = transfer(pixels, depth, pose, K_R, K_N)
    assert (there - wanted).abs().max() < 1e-6
    back, depth_again = transfer(there, neighbour_depth, torch.linalg.inv(pose), K_N, K_R)
    assert (back - pixels).abs().max() < 1e-6 and (depth_again - depth).abs().max() < 1e-9


def test_usual_mistakes_are_pixels_off():
    reference, neighbour = stereo(3)
    normal, pixels, rays, depth = on_plane(3)
    pose = relative_pose(reference, neighbour)
    distance = plane_distance(normal, rays, depth)
    wanted, _ = transfer(pixels, depth, pose, K_R, K_N)
    backwards = pose.clone()
    backwards[:3, 3] *= -1
    right = plane_homography(normal, distance, pose, K_R, K_N)
    mistakes = {
        "z-depth": plane_homography(normal, -depth, pose, K_R, K_N),
        "sign of T, or of d": plane_homography(normal, distance, backwards, K_R, K_N),
        "other direction": plane_homography(normal, distance, torch.linalg.inv(pose), K_R, K_N),
        "cameras swapped": plane_homography(normal, distance, pose, K_N, K_R),
    }
    for name, wrong in mistakes.items():
        assert (mapped(wrong, pixels) - wanted).norm(dim=-1).median() > 2, name
    assert (mapped(right.transpose(1, 2), pixels) - wanted).norm(dim=-1).median() > 2


def test_relative_pose_takes_the_reference_to_the_neighbour():
    reference, neighbour = stereo(5)
    torch.testing.assert_close(relative_pose(reference, neighbour) @ reference, neighbour)


def test_patches_are_warped_as_kornia_warps_them():
    generator = torch.Generator().manual_seed(0)
    homography = torch.eye(3, dtype=torch.float64) + 1e-3 * torch.rand(9, 3, 3, generator=generator)
    pixels = 100 * torch.rand(9, 2, generator=generator, dtype=torch.float64)
    offsets = patch_offsets(5, torch.float64)
    wanted = transform_points(homography, pixels[:, None] + offsets)
    x, y, weight = warp_points(homography, pixels, offsets)
    torch.testing.assert_close(torch.stack([x, y], -1), wanted)
    assert (weight > 0).all()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_planes_through_the_camera_and_along_the_ray_have_finite_gradients(dtype):
    rays = torch.tensor([[0.0, 0, 1], [0.3, -0.2, 1], [0, 0, 1]], dtype=dtype)
    normal = torch.tensor([[1.0, 0, 0], [0.5547002, 0.8320503, 0], [0, 0, -1]], dtype=dtype, requires_grad=True)
    depth = torch.tensor([2.0, 2.0, 0.0], dtype=dtype, requires_grad=True)
    reference, neighbour = (pose.to(dtype) for pose in stereo(1))
    distance = plane_distance(normal, rays, depth)
    assert distance.abs().tolist() == pytest.approx([0.1, 0.1, 1e-3], rel=1e-5)
    pixels = torch.full((3, 2), 50.0, dtype=dtype)
    homography = plane_homography(normal, distance, relative_pose(reference, neighbour), K_R.to(dtype), K_N.to(dtype))
    torch.stack(warp_points(homography, pixels, patch_offsets(7, dtype))[:2]).sum().backward()
    assert torch.isfinite(normal.grad).all() and torch.isfinite(depth.grad).all()


def test_an_image_is_sampled_with_pixel_centres_at_a_half():
    y, x = torch.meshgrid(torch.arange(6.0), torch.arange(9.0), indexing="ij")
    image = 10 * (x + 0.5) + (y + 0.5)
    at = (torch.tensor([[0.5, 3.25, 8.5]]), torch.tensor([[0.5, 2.75, 5.5]]))
    torch.testing.assert_close(bilinear(image, *at), 10 * at[0] + at[1])
    assert bilinear(image, torch.tensor([[-40.0]]), torch.tensor([[99.0]])).item() == image[-1, 0]


def test_patches_of_pixels_are_the_samples_at_their_offsets():
    image = torch.rand(11, 13, generator=torch.Generator().manual_seed(1))
    column, row = torch.tensor([2, 7, 10]), torch.tensor([8, 2, 5])
    offsets = patch_offsets(5)
    assert offsets[0].tolist() == [-2, -2] and offsets[1].tolist() == [-1, -2]
    patches = patches_at(image, column, row, 5)
    torch.testing.assert_close(
        patches, bilinear(image, column[:, None] + 0.5 + offsets[:, 0], row[:, None] + 0.5 + offsets[:, 1])
    )
    assert patches[1, 12] == image[2, 7]
