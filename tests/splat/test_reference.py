"""The oracle itself: against the paper's three planes, against finite differences, against geometry done by hand."""

from __future__ import annotations

import torch

from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.geometry.spherical_harmonics import sh_basis
from room2dgs.splat.reference import project, render
from room2dgs.splat.types import Surfels


def doubles(surfels: Surfels) -> Surfels:
    return Surfels(*(x.double() for x in surfels))


def test_centre_form_is_the_papers_three_planes(make_surfels, make_view):
    surfels = doubles(make_surfels(200, 8))
    K, cam_from_world = (x.double() for x in make_view())
    left, _, right = torch.linalg.svd(cam_from_world[:3, :3])  # float32 left it rigid to seven digits only
    cam_from_world[:3, :3] = left @ right
    p = project(surfels, K, cam_from_world, 0.05)
    pixels = torch.rand(200, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 50
    delta = pixels - p.center_px
    den = 1 + (p.b * delta).sum(-1)
    mine = torch.stack([(p.a_u * delta).sum(-1) / den, (p.a_v * delta).sum(-1) / den, p.depth / den], dim=-1)

    # eq. 5-7: the pixel's two planes, carried into the disc's frame by W H
    axes = rotation_matrices(surfels.rotations)
    H = torch.zeros(200, 4, 3, dtype=torch.float64)
    H[:, :3, 0] = axes[:, :, 0] * surfels.scales[:, :1]
    H[:, :3, 1] = axes[:, :, 1] * surfels.scales[:, 1:]
    H[:, :3, 2], H[:, 3, 2] = surfels.centers, 1
    M = K @ (cam_from_world[:3] @ H)  # rows: x z, y z, z over (u, v, 1)
    hu, hv = -M[:, 0] + pixels[:, :1] * M[:, 2], -M[:, 1] + pixels[:, 1:] * M[:, 2]
    bottom = hu[:, 0] * hv[:, 1] - hu[:, 1] * hv[:, 0]
    u = (hu[:, 1] * hv[:, 2] - hu[:, 2] * hv[:, 1]) / bottom
    v = (hu[:, 2] * hv[:, 0] - hu[:, 0] * hv[:, 2]) / bottom
    z = M[:, 2, 0] * u + M[:, 2, 1] * v + M[:, 2, 2]
    theirs = torch.stack([u, v, z], dim=-1)

    rays = surfels.centers @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    normals = (cam_from_world[:3, :3] @ axes)[:, :, 2]
    cosine = (rays * normals).sum(-1) / rays.norm(dim=-1)
    # edge-on discs and the horizon are left out: there the three planes themselves lose digits
    seen = p.visible & (cosine.abs() > 0.1) & (den > 1e-2)
    assert seen.sum() > 100
    torch.testing.assert_close(mine[seen], theirs[seen], rtol=1e-9, atol=1e-9)


def test_gradients_by_finite_differences(make_surfels, make_view):
    surfels = doubles(make_surfels(5, 11, (0.3, 0.8), 2.5, opacity=(0.3, 0.8)))
    K, cam_from_world = (x.double() for x in make_view())
    K = K * torch.tensor([[0.12], [0.12], [1.0]], dtype=torch.float64)
    center_px = torch.zeros(5, 2, dtype=torch.float64)
    intrinsics = torch.stack([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
    background = torch.tensor([1.0, 0.4, 0.1], dtype=torch.float64)
    inputs = [x.requires_grad_() for x in (*surfels, cam_from_world, center_px, intrinsics, background)]

    def images(*x):
        fx, fy, cx, cy = x[7]
        zero, one = torch.zeros((), dtype=torch.float64), torch.ones((), dtype=torch.float64)
        K = torch.stack([fx, zero, cx, zero, fy, cy, zero, zero, one]).reshape(3, 3)
        return tuple(render(Surfels(*x[:5]), K, x[5], 6, 5, background=x[8], center_px=x[6]))

    assert torch.autograd.gradcheck(images, inputs, eps=1e-7, atol=1e-5, rtol=1e-5)


def test_a_tilted_disc_has_its_planes_depth_and_normal(quaternions_facing):
    normal = torch.tensor([[0.3, -0.2, -0.9]])
    normal = normal / normal.norm()
    surfels = doubles(
        Surfels(
            torch.tensor([[0.1, 0.05, 2.0]]), quaternions_facing(normal), torch.full((1, 2), 5.0),
            torch.tensor([0.8]), torch.full((1, 1, 3), 0.5),
        )
    )  # fmt: skip
    K = torch.tensor([[40.0, 0, 16.2], [0, 42.0, 11.9], [0, 0, 1]], dtype=torch.float64)
    out = render(surfels, K, torch.eye(4, dtype=torch.float64), 32, 24, background=torch.ones(3))
    y, x = torch.meshgrid(torch.arange(24) + 0.5, torch.arange(32) + 0.5, indexing="ij")
    rays = torch.stack([(x - 16.2) / 40.0, (y - 11.9) / 42.0, torch.ones_like(x)], dim=-1).double()
    n = normal[0].double()
    plane_depth = (n @ surfels.centers[0]) / (rays @ n)
    away = (torch.stack([x, y], -1) - torch.tensor([16.2 + 2, 11.9 + 1.05])).norm(dim=-1) > 3  # not the filter
    torch.testing.assert_close(out.depth[away], plane_depth[away], rtol=1e-6, atol=1e-6)
    torch.testing.assert_close(out.normal[away], (out.alpha[..., None] * n)[away], rtol=1e-6, atol=1e-6)
    colour = 0.5 + 0.28209479177387814 * 0.5
    torch.testing.assert_close(out.color, (out.alpha * colour + 1 - out.alpha)[..., None].expand(24, 32, 3))
    # G = exp(-r^2 / 2) at the ray's hit, r in units of the scale
    r2 = ((rays * plane_depth[..., None] - surfels.centers[0]) ** 2).sum(-1) / 25
    torch.testing.assert_close(out.alpha[away], (0.8 * torch.exp(-r2 / 2))[away], rtol=1e-6, atol=1e-6)


def test_two_frontal_discs_blend_by_hand():
    surfels = Surfels(
        torch.tensor([[0.0, 0, 3.0], [0, 0, 2.0]]), torch.tensor([[1.0, 0, 0, 0]] * 2), torch.full((2, 2), 10.0),
        torch.tensor([0.7, 0.4]), torch.tensor([[[1.0, 0, 0]], [[0, 1.0, 0]]]),
    )  # fmt: skip
    K = torch.tensor([[20.0, 0, 0.5], [0, 20.0, 0.5], [0, 0, 1]])
    out = render(
        doubles(surfels),
        K.double(),
        torch.eye(4, dtype=torch.float64),
        1,
        1,
        background=torch.tensor([0, 0, 1.0]),
    )
    w_near, w_far = 0.4, 0.6 * 0.7
    c = 0.28209479177387814
    color = torch.tensor([0.5, 0.5 + c, 0.5]) * w_near + torch.tensor([0.5 + c, 0.5, 0.5]) * w_far
    color = color + (1 - w_near - w_far) * torch.tensor([0, 0, 1.0])
    torch.testing.assert_close(out.color[0, 0].float(), color)
    assert abs(out.alpha.item() - (w_near + w_far)) < 1e-7
    assert abs(out.depth.item() - (2 * w_near + 3 * w_far) / (w_near + w_far)) < 1e-6
    assert out.median_depth.item() == 3.0  # 0.6 of the light is left behind the first
    assert torch.allclose(out.normal[0, 0], torch.tensor([0, 0, -(w_near + w_far)]).double())
    k = 100 * 0.2 / 99.8
    assert abs(out.distortion.item() - w_near * w_far * (k / 2 - k / 3) ** 2) < 1e-9


def test_spherical_harmonics_are_orthonormal():
    n = 400
    z = (torch.arange(n, dtype=torch.float64) + 0.5) / n * 2 - 1
    phi = torch.arange(16, dtype=torch.float64) / 16 * 2 * torch.pi
    ring = (1 - z * z).sqrt()[:, None]
    directions = torch.stack([ring * phi.cos(), ring * phi.sin(), z[:, None].expand(n, 16)], -1).reshape(-1, 3)
    basis = sh_basis(directions, 16)
    gram = basis.T @ basis * 4 * torch.pi / len(directions)
    torch.testing.assert_close(gram, torch.eye(16, dtype=torch.float64), rtol=0, atol=1e-4)
