"""`splat.rasterization`: gsplat's arguments and results, as its example trainer uses them."""

from __future__ import annotations

import pytest
import torch

from room2dgs import splat
from room2dgs.splat import Gaussians

WIDTH, HEIGHT = 40, 30


@pytest.fixture
def scene(make_surfels, make_view):
    """means, quats, scales, opacities, SH coefficients, viewmats and Ks of two cameras."""
    s = make_surfels(50, 3)
    scales = torch.cat([s.scales, 0.4 * s.scales[:, :1]], dim=1)
    views = [make_view(), make_view(angle=0.3)]
    Ks, poses = torch.stack([K for K, _ in views]), torch.stack([pose for _, pose in views])
    leaves = [x.clone().requires_grad_() for x in (s.centers, s.rotations, scales, s.opacities, s.sh)]
    return dict(zip(("means", "quats", "scales", "opacities", "colors"), leaves, strict=True)), poses, Ks


def test_views_are_those_of_render(scene):
    tensors, poses, Ks = scene
    backgrounds = torch.tensor([[0.1, 0.2, 0.3], [0.5, 0.4, 0.6]])
    options = {"sh_degree": 1, "backgrounds": backgrounds, "near_plane": 0.05, "render_mode": "RGB+ED"}
    for mode, antialias in (("classic", False), ("antialiased", True)):
        colors, alphas, meta = splat.rasterization(
            **tensors, viewmats=poses, Ks=Ks, width=WIDTH, height=HEIGHT, rasterize_mode=mode, packed=False, **options
        )
        assert colors.shape == (2, HEIGHT, WIDTH, 4) and alphas.shape == (2, HEIGHT, WIDTH, 1)
        for k in range(2):
            out = splat.render_gaussians(
                Gaussians(*tensors.values()), Ks[k], poses[k], WIDTH, HEIGHT, background=backgrounds[k],
                antialias=antialias, filter_px2=0.3,
            )  # fmt: skip
            assert torch.equal(colors[k, ..., :3], out.color) and torch.equal(colors[k, ..., 3], out.depth)
            assert torch.equal(alphas[k, ..., 0], out.alpha)
        assert (meta["width"], meta["height"], meta["n_cameras"], meta["n_batches"]) == (WIDTH, HEIGHT, 2, 1)


def test_accumulated_depth_is_expected_depth_times_alpha(scene):
    tensors, poses, Ks = scene
    (both, alphas, _), (depth, _, _) = (
        splat.rasterization(**tensors, viewmats=poses, Ks=Ks, width=40, height=30, sh_degree=1, render_mode=mode)
        for mode in ("RGB+ED", "D")
    )
    torch.testing.assert_close(depth, both[..., 3:] * alphas)


def test_values_of_any_number_are_blended_and_their_gradients_are_the_weights(scene):
    tensors, poses, Ks = scene
    values = torch.linspace(-3, 4, 50 * 5).reshape(50, 5).requires_grad_()
    colors, alphas, _ = splat.rasterization(
        **{**tensors, "colors": values}, viewmats=poses, Ks=Ks, width=40, height=30, packed=False
    )
    assert colors.shape == (2, 30, 40, 5)
    ones, _, _ = splat.rasterization(
        **{**tensors, "colors": torch.ones(50, 1)}, viewmats=poses, Ks=Ks, width=40, height=30, packed=False
    )
    torch.testing.assert_close(ones, alphas, atol=1e-5, rtol=0)
    (weights,) = torch.autograd.grad(colors.sum(), values)
    torch.testing.assert_close((weights * values).sum(), colors.sum(), rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("packed", [False, True])
def test_the_gradient_of_means2d_is_what_gsplats_strategies_read(scene, packed):
    tensors, poses, Ks = scene
    colors, _, meta = splat.rasterization(
        **tensors, viewmats=poses, Ks=Ks, width=WIDTH, height=HEIGHT, sh_degree=1, packed=packed
    )
    meta["means2d"].retain_grad()
    colors.square().sum().backward()
    expected = []
    for k in range(2):
        center_px = torch.zeros(50, 2, requires_grad=True)
        out = splat.render_gaussians(
            Gaussians(*(x.detach() for x in tensors.values())), Ks[k], poses[k], WIDTH, HEIGHT, center_px=center_px,
            near_m=0.01,
        )  # fmt: skip
        out.color.square().sum().backward()
        expected.append(center_px.grad)
    expected = torch.stack(expected)
    seen = (meta["radii"] > 0).all(-1)
    if packed:
        assert seen.all() and len(meta["gaussian_ids"]) == len(meta["means2d"]) < 100
        found = torch.zeros(2, 50, 2)
        found[meta["camera_ids"], meta["gaussian_ids"]] = meta["means2d"].grad
    else:
        found = meta["means2d"].grad
        assert not expected[~seen].any()
    assert expected.any() and torch.equal(found, expected)


def test_radii_hold_all_that_is_drawn(scene):
    tensors, poses, Ks = scene
    _, _, meta = splat.rasterization(
        **tensors, viewmats=poses, Ks=Ks, width=WIDTH, height=HEIGHT, sh_degree=1, packed=False
    )
    first = {"viewmats": poses[:1], "Ks": Ks[:1], "width": WIDTH, "height": HEIGHT, "sh_degree": 1}
    for k in range(50):
        one = {name: x[k : k + 1] for name, x in tensors.items()}
        _, alphas, _ = splat.rasterization(**one, **first)
        rows, columns = (alphas[0, ..., 0] > 0).nonzero().unbind(1)
        assert bool(len(rows)) <= bool((meta["radii"][0, k] > 0).all())
        if len(rows):
            far = torch.stack([columns + 0.5, rows + 0.5], 1) - meta["means2d"][0, k]
            assert (far.abs() <= meta["radii"][0, k]).all()
            assert (far.abs().amax(0) > 0.4 * meta["radii"][0, k] - 1.5).any()


def test_batches_are_rendered_one_after_another(scene):
    tensors, poses, Ks = scene
    both = {name: torch.stack([x, x.roll(1, 0)]) for name, x in tensors.items()}
    colors, _, meta = splat.rasterization(
        **both, viewmats=torch.stack([poses, poses]), Ks=torch.stack([Ks, Ks]), width=40, height=30, sh_degree=1
    )
    one, _, _ = splat.rasterization(**tensors, viewmats=poses, Ks=Ks, width=40, height=30, sh_degree=1)
    assert torch.equal(colors[0], one) and meta["n_batches"] == 2 and set(meta["batch_ids"].tolist()) == {0, 1}


def test_planes_leave_out_what_is_beyond(scene):
    tensors, poses, Ks = scene
    whole, _, _ = splat.rasterization(**tensors, viewmats=poses, Ks=Ks, width=40, height=30, sh_degree=1)
    depths = tensors["means"].detach() @ poses[0, 2, :3] + poses[0, 2, 3]
    kept = (depths <= 3.0).nonzero()[:, 0]
    part, _, meta = splat.rasterization(
        **tensors, viewmats=poses[:1], Ks=Ks[:1], width=40, height=30, sh_degree=1, far_plane=3.0
    )
    few = {name: x[kept] for name, x in tensors.items()}
    alone, _, _ = splat.rasterization(**few, viewmats=poses[:1], Ks=Ks[:1], width=40, height=30, sh_degree=1)
    assert torch.equal(part, alone) and not torch.equal(part, whole[:1])
    assert set(meta["gaussian_ids"].tolist()) <= set(kept.tolist())


def test_gaussians_of_a_few_pixels_can_be_left_out(scene):
    tensors, poses, Ks = scene
    call = {"viewmats": poses[:1], "Ks": Ks[:1], "width": WIDTH, "height": HEIGHT, "sh_degree": 1, "packed": False}
    _, _, meta = splat.rasterization(**tensors, **call)
    reach = meta["radii"][0].amax(-1)
    clip = reach[reach > 0].float().quantile(0.5).item() + 0.5
    kept = (reach > clip).nonzero()[:, 0]
    clipped, _, meta = splat.rasterization(**tensors, **call, radius_clip=clip)
    alone, _, _ = splat.rasterization(**{name: x[kept] for name, x in tensors.items()}, **call)
    assert 0 < len(kept) < (reach > 0).sum() and torch.equal(clipped, alone)
    assert meta["radii"][0].any(-1).nonzero()[:, 0].tolist() == kept.tolist()
    clipped.sum().backward()
    left_out = torch.ones(50, dtype=torch.bool).index_fill(0, kept, False)
    assert all(not x.grad[left_out].any() and x.grad[kept].any() for x in tensors.values())


def test_depth_needs_no_colours(scene):
    tensors, poses, Ks = scene
    call = {"viewmats": poses, "Ks": Ks, "width": WIDTH, "height": HEIGHT}
    depth, _, _ = splat.rasterization(**{**tensors, "colors": None}, **call, render_mode="ED")
    both, _, _ = splat.rasterization(**tensors, **call, sh_degree=1, render_mode="RGB+ED")
    assert torch.equal(depth, both[..., 3:])
    with pytest.raises(TypeError, match="colors"):
        splat.rasterization(**{**tensors, "colors": None}, **call)


@pytest.mark.parametrize(
    "options",
    [{"absgrad": True}, {"return_normals": True}, {"camera_model": "fisheye"}, {"with_ut": True},
     {"covars": torch.eye(3)}, {"radial_coeffs": torch.zeros(4)}, {"distributed": True}, {"global_z_order": False}],
)  # fmt: skip
def test_options_that_are_not_there_are_refused_by_name(scene, options):
    tensors, poses, Ks = scene
    with pytest.raises(NotImplementedError, match=next(iter(options))):
        splat.rasterization(**tensors, viewmats=poses, Ks=Ks, width=8, height=8, sh_degree=1, **options)


def test_what_does_not_fit_is_refused(scene):
    tensors, poses, Ks = scene
    call = {**tensors, "viewmats": poses, "Ks": Ks, "width": 8, "height": 8, "sh_degree": 1}
    with pytest.raises(ValueError, match=r"scales has shape \(50, 2\)"):
        splat.rasterization(**{**call, "scales": tensors["scales"][:, :2]})
    with pytest.raises(ValueError, match="rasterize_mode"):
        splat.rasterization(**call, rasterize_mode="sharp")
    with pytest.raises(ValueError, match="far_plane"):
        splat.rasterization(**call, far_plane=0.001)
