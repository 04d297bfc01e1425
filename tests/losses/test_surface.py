"""Normal consistency and distortion: the kernel against the reference, and both against known scenes."""

import numpy as np
import pytest
import torch

from room2dgs import _C
from room2dgs.geometry.depth_maps import depth_to_normals
from room2dgs.losses import reference
from room2dgs.losses.surface import distortion, normal_consistency
from room2dgs.splat.types import Rendering


def rendering_of(depth, alpha, normal):
    """The other depth is garbage, so that taking the wrong one shows."""
    garbage = torch.full_like(depth, 3.0)
    return Rendering(torch.zeros_like(normal), alpha, depth, garbage, normal, torch.zeros_like(depth))


def random_maps(height, width, seed=0, holes=True):
    generator = torch.Generator().manual_seed(seed)
    depth = 2 + torch.rand(height, width, generator=generator)
    if holes:
        depth[torch.rand(height, width, generator=generator) < 0.03] = 0
    alpha = torch.rand(height, width, generator=generator)
    return depth, alpha, torch.randn(height, width, 3, generator=generator)


def gradients(loss, depth, normal, pose):
    leaves = [t.clone().requires_grad_() for t in (depth, normal, pose)]
    value = loss(*leaves)
    value.backward()
    return value.item(), [t.grad for t in leaves]


def kernel_gradients(depth, alpha, normal, K, pose):
    return gradients(lambda d, n, p: normal_consistency(rendering_of(d, alpha, n), K, p), depth, normal, pose)


@pytest.mark.parametrize("size", [(1, 1), (2, 9), (3, 3), (5, 5), (16, 8), (17, 31), (34, 64), (50, 43)])
def test_kernel_equals_the_reference(camera, size):
    depth, alpha, normal = random_maps(*size)
    pose = torch.from_numpy(camera.cam_from_world)
    value, got = kernel_gradients(depth, alpha, normal, camera.K, pose)
    wanted, exact = gradients(
        lambda d, n, p: reference.normal_consistency(d, alpha.double(), n, camera.K, p),
        depth.double(),
        normal.double(),
        pose,
    )
    assert abs(value - wanted) <= 1e-5 * abs(wanted)
    for mine, theirs in zip(got, exact, strict=True):
        assert (mine - theirs).abs().max() <= 1e-4 * theirs.abs().max()


def test_reference_gradcheck(camera):
    depth, alpha, normal = (t.double() for t in random_maps(6, 7))
    pose = torch.from_numpy(camera.cam_from_world)
    torch.autograd.gradcheck(
        lambda d, n, p: reference.normal_consistency(d, alpha, n, camera.K, p),
        [t.requires_grad_() for t in (depth, normal, pose)],
    )


def test_zero_for_a_surface_that_agrees_with_itself_whatever_its_coverage(camera):
    depth, alpha, _ = random_maps(20, 30)
    normal = alpha[..., None] * depth_to_normals(depth, camera.K, camera.cam_from_world)
    value = normal_consistency(rendering_of(depth, alpha, normal), camera.K, camera.cam_from_world)
    assert abs(value.item()) < 1e-7


def test_normals_against_the_surface_cost_two(camera):
    # A normal that faces away is the commonest mistake of conventions.
    depth, _, _ = random_maps(20, 30, holes=False)
    normal = -depth_to_normals(depth, camera.K, camera.cam_from_world)
    value = normal_consistency(rendering_of(depth, torch.ones_like(depth), normal), camera.K, camera.cam_from_world)
    assert value.item() == pytest.approx(2 * 18 * 28 / (20 * 30), rel=1e-5)


def test_a_step_down_the_gradient_turns_the_depth_towards_the_normals(camera):
    depth = torch.full((38, 45), 2.0)
    towards = camera.cam_from_world[:3, :3].T @ np.array([0.3, 0.1, -0.95])
    normal = torch.from_numpy(towards / np.linalg.norm(towards)).float().expand(38, 45, 3).contiguous()
    gradient = kernel_gradients(
        depth, torch.ones_like(depth), normal, camera.K, torch.from_numpy(camera.cam_from_world)
    )[1][0]
    # n_x > 0 in the camera frame asks for a depth that rises to the right
    x = torch.arange(45).expand(38, 45) - 22.0
    assert (-gradient * x).sum() > 0


def test_alpha_gets_no_gradient(camera):
    depth, alpha, normal = random_maps(10, 10)
    alpha.requires_grad_()
    normal.requires_grad_()
    normal_consistency(rendering_of(depth, alpha, normal), camera.K, camera.cam_from_world).backward()
    assert alpha.grad is None
    assert normal.grad.abs().max() > 0


def test_median_depth_is_taken_when_asked_for(camera):
    depth, alpha, normal = random_maps(10, 12)
    expected = normal_consistency(rendering_of(depth, alpha, normal), camera.K, camera.cam_from_world)
    swapped = rendering_of(depth, alpha, normal)._replace(depth=torch.full_like(depth, 3.0), median_depth=depth)
    median = normal_consistency(swapped, camera.K, camera.cam_from_world, depth="median")
    assert median.item() == expected.item()
    with pytest.raises(ValueError, match="expected or median"):
        normal_consistency(swapped, camera.K, camera.cam_from_world, depth="mean")


@pytest.mark.parametrize("bad", [0.0, float("nan"), float("inf")])
def test_invalid_depths_poison_nothing(camera, bad):
    depth, alpha, normal = random_maps(20, 30, holes=False)
    depth[9, 11] = bad
    pose = torch.from_numpy(camera.cam_from_world)
    value, (grad_depth, grad_normal, grad_pose) = kernel_gradients(depth, alpha, normal, camera.K, pose)
    assert np.isfinite(value)
    assert all(torch.isfinite(g).all() for g in (grad_depth, grad_normal, grad_pose))
    assert grad_depth[9, 11] == 0
    wiped = {tuple(p) for p in (grad_normal[1:-1, 1:-1] == 0).all(-1).nonzero().tolist()}
    assert wiped == {(8, 10), (7, 10), (9, 10), (8, 9), (8, 11)}


def test_empty_rendering_costs_nothing(camera):
    depth, alpha, normal = torch.zeros(9, 9), torch.zeros(9, 9), torch.zeros(9, 9, 3)
    value, grads = kernel_gradients(depth, alpha, normal, camera.K, torch.from_numpy(camera.cam_from_world))
    assert value == 0
    assert all((g == 0).all() for g in grads)


def test_same_bits_on_any_number_of_threads(camera):
    depth, alpha, normal = random_maps(70, 33)
    before = _C.threads()
    results = []
    for count in (1, 2):
        _C.set_threads(count)
        pose = torch.from_numpy(camera.cam_from_world)
        results.append(kernel_gradients(depth, alpha, normal, camera.K, pose))
    _C.set_threads(before)
    assert results[0][0] == results[1][0]
    assert all(torch.equal(a, b) for a, b in zip(results[0][1], results[1][1], strict=True))


def test_distortion_is_the_mean_of_its_map():
    depth = torch.ones(4, 5)
    rendering = rendering_of(depth, depth, depth[..., None].expand(4, 5, 3))
    rendering = rendering._replace(distortion=torch.arange(20.0).reshape(4, 5))
    assert distortion(rendering).item() == pytest.approx(9.5)
