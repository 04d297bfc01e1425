"""The oracle of 3D Gaussians: against finite differences, against perspective by autograd, against planes and rays."""

from __future__ import annotations

import pytest
import torch

from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.splat import Gaussians, reference
from room2dgs.splat.gaussians.reference import project, render


@pytest.fixture
def make_gaussians(make_surfels):
    """A call gives float64 Gaussians; `flat` is the third scale as a share of the smaller of the two others."""

    def make(count, seed, scale=(0.02, 0.22), flat=0.5, **options):
        s = make_surfels(count, seed, scale, **options)
        scales = torch.cat([s.scales, flat * s.scales.amin(dim=1, keepdim=True)], dim=1)
        return Gaussians(*(x.double() for x in (s.centers, s.rotations, scales, s.opacities, s.sh)))

    return make


@pytest.fixture
def view(make_view):
    K, pose = (x.double() for x in make_view())
    left, _, right = torch.linalg.svd(pose[:3, :3])
    pose[:3, :3] = left @ right
    return K, pose


@pytest.mark.parametrize("antialias", [False, True])
def test_gradients_by_finite_differences(make_gaussians, view, antialias):
    gaussians = make_gaussians(4, 11, (0.3, 0.8), opacity=(0.3, 0.8), depth=2.5)
    K, pose = view
    small = torch.stack([K[0, 0], K[1, 1], K[0, 2], K[1, 2]]) * 0.12
    inputs = [x.requires_grad_() for x in (*gaussians, pose, torch.zeros(4, 2).double(), small)]

    def images(*x):
        fx, fy, cx, cy = x[7]
        zero, one = torch.zeros_like(fx), torch.ones_like(fx)
        camera = torch.stack([fx, zero, cx, zero, fy, cy, zero, zero, one]).reshape(3, 3)
        out = render(Gaussians(*x[:5]), camera, x[5], 5, 4, center_px=x[6], antialias=antialias)
        return torch.cat([image.flatten() for image in out])

    assert torch.autograd.gradcheck(images, inputs, eps=1e-6, atol=1e-5, rtol=1e-4, fast_mode=True)


def test_ellipses_are_the_covariance_through_perspectives_derivative(make_gaussians, view):
    gaussians, (K, pose) = make_gaussians(30, 3), view
    p = project(gaussians, K, pose, 46, 38, 0.05, filter_px2=0.3)
    for k in torch.nonzero(p.visible)[:, 0]:
        axes = rotation_matrices(gaussians.rotations[k : k + 1])[0] * gaussians.scales[k]
        in_camera = pose[:3, :3] @ axes @ axes.T @ pose[:3, :3].T
        center = pose[:3, :3] @ gaussians.centers[k] + pose[:3, 3]
        pixel = (K @ center)[:2] / center[2]
        if (pixel < 0).any() or (pixel > torch.tensor([46, 38])).any():
            continue  # held at the view's edge, further out
        J = torch.autograd.functional.jacobian(lambda x: (K @ x)[:2] / x[2], center)
        expected = torch.linalg.inv(J @ in_camera @ J.T + 0.3 * torch.eye(2).double())
        factor = torch.stack([p.a_u[k], p.a_v[k]])
        torch.testing.assert_close(factor.T @ factor, expected, rtol=1e-9, atol=1e-12)


def test_a_flat_gaussian_has_its_planes_depth_and_normal(make_gaussians, view):
    """As a surfel has: perspective keeps planes in 1/z, so nothing is lost by the linear map. Without the filter."""
    gaussians, (K, pose) = make_gaussians(40, 5, flat=1e-7), view
    p = project(gaussians, K, pose, 46, 38, 0.05, filter_px2=1e-9)
    surfels = reference.Surfels(*gaussians)._replace(scales=gaussians.scales[:, :2])
    disc = reference.project(surfels, K, pose, 0.05)
    axis = rotation_matrices(gaussians.rotations)[:, :, 2]
    ray = gaussians.centers + pose[:3, :3].T @ pose[:3, 3]
    steep = (axis * ray).sum(-1).abs() / ray.norm(dim=-1) > 0.2
    d = gaussians.centers @ pose[:3, :3].T + pose[:3, 3]
    central = (d[:, :2].abs() / d[:, 2:] < 0.3).all(-1)
    chosen = p.visible & steep & central
    assert chosen.sum() > 10
    torch.testing.assert_close(p.b[chosen], disc.b[chosen], rtol=1e-4, atol=1e-7)
    torch.testing.assert_close(p.normal[chosen], disc.normal[chosen], rtol=0, atol=1e-4)


def test_depth_is_where_the_gaussian_is_densest_along_the_ray():
    """A small, thick Gaussian: the maximum of its density along neighbouring rays, by its 3D quadratic form."""
    size = 1e-4
    rotation = torch.tensor([[0.8, 0.3, -0.2, 0.4]], dtype=torch.float64)
    scales = size * torch.tensor([[1.0, 0.6, 0.3]], dtype=torch.float64)
    center = torch.tensor([[0.3, -0.2, 2.0]], dtype=torch.float64)
    gaussian = Gaussians(center, rotation, scales, torch.ones(1).double(), torch.zeros(1, 1, 3).double())
    K = torch.tensor([[5e4, 0, 1e4], [0, 6e4, 1e4], [0, 0, 1]], dtype=torch.float64)
    p = project(gaussian, K, torch.eye(4).double(), 20000, 20000, 0.05, filter_px2=1e-9)
    axes = rotation_matrices(rotation)[0] * scales
    precision = torch.linalg.inv(axes @ axes.T)
    for offset in ([1.0, 0.0], [0.0, 1.0], [-1.5, 2.0]):
        delta = torch.tensor(offset).double()
        ray = torch.linalg.inv(K) @ torch.cat([p.center_px[0] + delta, torch.ones(1).double()])
        densest = (ray @ precision @ center[0]) / (ray @ precision @ ray)  # times a ray of z = 1
        z = p.depth[0] / (1 + (p.b[0] * delta).sum())
        assert abs(z - densest) < 0.001 * abs(densest - 2.0)


def test_compensation_keeps_the_light_of_each_ellipse(make_gaussians, view):
    """Opacity times area on the screen is what it is without the filter, which alone makes small ones larger."""
    gaussians, (K, pose) = make_gaussians(50, 9, (0.001, 0.05)), view

    def light(**options):
        p = project(gaussians, K, pose, 46, 38, 0.05, **options)
        return torch.where(p.visible, p.opacity / (p.a_u[:, 0] * p.a_v[:, 1]), 0.0)

    bare = light(filter_px2=1e-12)
    torch.testing.assert_close(light(filter_px2=0.1, compensated=True), bare, rtol=1e-5, atol=0)
    assert (light(filter_px2=0.1)[bare > 0] > 1.01 * bare[bare > 0]).all()
