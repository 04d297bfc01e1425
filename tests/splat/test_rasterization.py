"""`rasterization_2dgs`: another door to the same renderer."""

from __future__ import annotations

import pytest
import torch

from room2dgs import splat
from room2dgs.geometry.depth_maps import depth_to_normals
from room2dgs.geometry.spherical_harmonics import sh_color
from room2dgs.splat import Surfels, rasterization_2dgs, reference

SIZE = (53, 40)


@pytest.fixture
def views(make_view):
    """Ks (2, 3, 3) and viewmats (2, 4, 4)."""
    (K, pose), (_, other) = make_view(), make_view(angle=0.3)
    return torch.stack([K, K * torch.tensor([[1.2], [0.9], [1.0]])]), torch.stack([pose, other])


def drawn(surfels, views, colors=None, **options):
    Ks, viewmats = views
    colors = surfels.sh if colors is None else colors
    return rasterization_2dgs(*surfels[:4], colors, viewmats, Ks, *SIZE, **options)


@torch.no_grad()
def test_each_view_is_that_of_render(make_surfels, views):
    surfels = make_surfels(120, 3, sh=9)
    backgrounds = torch.tensor([[0.1, 0.2, 0.3], [0.9, 0.5, 0.0]])
    options = {"sh_degree": 1, "backgrounds": backgrounds, "distloss": True, "near_plane": 0.05}
    colors, alphas, normals, surf_normals, distort, median, meta = drawn(
        surfels, views, render_mode="RGB+ED", **options
    )
    accumulated = drawn(surfels, views, render_mode="D", **options)[0]
    for k, (K, pose) in enumerate(zip(*views, strict=True)):
        out = splat.render(surfels._replace(sh=surfels.sh[:, :4]), K, pose, *SIZE, background=backgrounds[k])
        assert torch.equal(colors[k], torch.cat([out.color, out.depth[..., None]], -1))
        assert torch.equal(accumulated[k, ..., 0], out.depth * out.alpha)
        assert torch.equal(alphas[k, ..., 0], out.alpha) and torch.equal(median[k, ..., 0], out.median_depth)
        assert torch.equal(normals[k], out.normal) and torch.equal(distort[k, ..., 0], out.distortion)
        assert torch.equal(surf_normals[k], depth_to_normals(out.depth, K, pose))
    assert meta["n_cameras"] == 2 and (meta["width"], meta["height"]) == SIZE


def test_batch_dimensions_are_rendered_one_by_one(make_surfels, views):
    scenes = [make_surfels(30, seed) for seed in range(6)]
    surfels = Surfels(*(torch.stack(x).reshape(2, 3, *x[0].shape) for x in zip(*scenes, strict=True)))
    Ks, viewmats = (x.expand(2, 3, *x.shape).clone() for x in views)
    viewmats[1, 2, 0, 0, 3] += 0.3  # its own cameras
    many = rasterization_2dgs(*surfels[:4], surfels.sh, viewmats, Ks, *SIZE, sh_degree=1, render_mode="RGB+D")
    assert many[0].shape == (2, 3, 2, 40, 53, 4) and many[1].shape == (2, 3, 2, 40, 53, 1)
    assert many[3].shape == (2, 3, 2, 40, 53, 3)
    assert many[-1]["n_batches"] == 6 and many[-1]["gradient_2dgs"].shape == (2, 3, 2, 30, 2)
    for b in range(2):
        for c in range(3):
            one = rasterization_2dgs(
                *(x[b, c] for x in surfels[:4]), surfels.sh[b, c], viewmats[b, c], Ks[b, c], *SIZE,
                sh_degree=1, render_mode="RGB+D",
            )  # fmt: skip
            for x, y in zip(many[:-1], one[:-1], strict=True):
                assert torch.equal(x[b, c], y)
            assert torch.equal(many[-1]["radii"][b, c], one[-1]["radii"])


@pytest.mark.parametrize("per_camera", [False, True])
def test_values_of_any_number_of_channels(make_surfels, views, per_camera):
    """Five channels, with negative and black ones, which the renderer's clamp would swallow with their gradient."""
    surfels = make_surfels(80, 5)
    values = torch.randn(2, 80, 5, generator=torch.Generator().manual_seed(1))
    values[:, :, 3] = 0
    backgrounds = torch.rand(2, 5, generator=torch.Generator().manual_seed(2))
    leaf = (values if per_camera else values[0]).clone().requires_grad_()
    image = drawn(surfels, views, leaf, backgrounds=backgrounds)[0]
    assert image.shape == (2, 40, 53, 5)
    weights = torch.randn(image.shape, generator=torch.Generator().manual_seed(3))
    (gradient,) = torch.autograd.grad((image * weights).sum(), leaf)
    # the image is linear in the values, so one-hot values of each surfel give the weights to expect
    for k, (K, pose) in enumerate(zip(*views, strict=True)):
        exact = Surfels(*(x.double() for x in surfels))
        out = reference.render(exact, K, pose, *SIZE)
        base = (1 - out.alpha)[..., None] * backgrounds[k]
        total = torch.zeros(40, 53, 5, dtype=torch.float64)
        for channel in range(5):
            v = values[k if per_camera else 0, :, channel].double()
            lift = -v.min() + 1
            sh = ((v + lift - 0.5) / 0.28209479177387814)[:, None, None].expand(80, 1, 3)
            c = reference.render(exact._replace(sh=sh), K, pose, *SIZE).color[..., 0]
            total[..., channel] = c - lift * out.alpha
        wrong = ((image[k] - (total + base)).abs() > 2e-5).any(-1)
        assert wrong.sum() <= 2  # pixels beside a jump
    flat = gradient.reshape(-1, 5)
    step = torch.zeros_like(leaf)
    step.reshape(-1, 5)[7, 3] = 1.0  # one of the black ones
    moved = drawn(surfels, views, (leaf + step).detach(), backgrounds=backgrounds)[0]
    torch.testing.assert_close(((moved - image) * weights).sum(), flat[7, 3], rtol=1e-3, atol=1e-4)
    assert flat[:, 3].count_nonzero() > 40


def test_coefficients_and_values_agree(make_surfels, views):
    surfels = make_surfels(80, 5, sh=4)
    colors = torch.stack(
        [
            sh_color(surfels.sh, torch.nn.functional.normalize(surfels.centers + pose[:3, :3].T @ pose[:3, 3], dim=-1))
            for pose in views[1]
        ]
    )
    by_sh = drawn(surfels, views, sh_degree=1)[0]
    by_value = drawn(surfels, views, colors)[0]
    torch.testing.assert_close(by_value, by_sh, rtol=1e-4, atol=1e-4)


def test_gradients_flow_to_everything(make_surfels, views):
    surfels = Surfels(*(x.requires_grad_() for x in make_surfels(60, 6)))
    Ks, viewmats = (x.clone().requires_grad_() for x in views)
    backgrounds = torch.rand(2, 3).requires_grad_()
    out = rasterization_2dgs(
        *surfels[:4], surfels.sh, viewmats, Ks, *SIZE, sh_degree=1, render_mode="RGB+ED", backgrounds=backgrounds,
        distloss=True,
    )  # fmt: skip
    sum((x * x).sum() for x in out[:-1]).backward()
    for name, x in [*zip(Surfels._fields, surfels, strict=True), ("Ks", Ks), ("viewmats", viewmats)]:
        assert torch.isfinite(x.grad).all() and x.grad.any(), name
    assert backgrounds.grad.all()
    screen = out[-1]["gradient_2dgs"].grad
    assert screen.shape == (2, 60, 2)
    seen = (out[-1]["radii"] > 0).all(-1)
    assert seen.any() and not screen[~seen].any()
    assert screen[seen].any(-1).float().mean() > 0.8


def test_a_third_scale_and_far_surfels_are_nothing(make_surfels, views):
    surfels = make_surfels(100, 7)
    expected = drawn(surfels, views, sh_degree=1)
    scales = torch.cat([surfels.scales, torch.full((100, 1), 9.0)], -1)
    assert torch.equal(drawn(surfels._replace(scales=scales), views, sh_degree=1)[0], expected[0])

    far = 3.2
    actual = drawn(surfels, views, sh_degree=1, far_plane=far)
    for k, (K, pose) in enumerate(zip(*views, strict=True)):
        near_enough = surfels.centers @ pose[2, :3] + pose[2, 3] <= far
        assert 0 < near_enough.sum() < 100
        few = Surfels(*(x[near_enough] for x in surfels))
        assert torch.equal(actual[0][k], splat.render(few, K, pose, *SIZE, near_m=0.01).color)
        assert not actual[-1]["radii"][k][~near_enough].any()


def test_radii_hold_what_is_drawn(make_surfels, views):
    """Alone on the screen, a surfel's pixels above 1.2 % of its opacity (three deviations) lie in its box."""
    surfels = make_surfels(40, 8, (0.02, 0.4), 1.0)._replace(opacities=torch.full((40,), 0.9))
    meta = drawn(surfels, views, sh_degree=1)[-1]
    y, x = torch.meshgrid(torch.arange(40) + 0.5, torch.arange(53) + 0.5, indexing="ij")
    pixels, boxes = torch.stack([x, y], -1), 0
    for k, (K, pose) in enumerate(zip(*views, strict=True)):
        for i in range(40):
            one = Surfels(*(v[i : i + 1] for v in surfels))
            alpha = splat.render(one, K, pose, *SIZE, near_m=0.01).alpha
            lit = alpha > 0.9 * 0.0112
            radius, center = meta["radii"][k, i], meta["means2d"][k, i]
            assert (radius > 0).all() or not lit.any()
            inside = ((pixels - center).abs() <= radius).all(-1)
            assert not (lit & ~inside).any()
            boxes += int((radius > 0).all() and lit.any())
    assert boxes > 30


@pytest.mark.parametrize(
    "option",
    [{"packed": True}, {"sparse_grad": True}, {"absgrad": True}, {"radius_clip": 2.0}, {"eps2d": 0.1}],
)
def test_an_option_that_cannot_be_honoured_is_refused(make_surfels, views, option):
    with pytest.raises(NotImplementedError, match=next(iter(option))):
        drawn(make_surfels(5), views, sh_degree=1, **option)


@pytest.mark.parametrize(
    ("option", "sentence"),
    [
        ({"render_mode": "RGBD"}, "render_mode"), ({"depth_mode": "mean"}, "depth_mode"),
        ({"sh_degree": 2}, "sh_degree 2"), ({"far_plane": 0.001}, "far_plane"),
        ({"backgrounds": torch.zeros(3)}, "backgrounds has shape"), ({"near_plane": -1.0}, "near_m"),
        ({"sh_degree": None}, "colors has shape"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(make_surfels, views, option, sentence):
    with pytest.raises(ValueError, match=sentence):
        drawn(make_surfels(5), views, **({"sh_degree": 1} | option))
