"""The calls of gsplat's examples/simple_trainer.py and of its strategies, with `splat.rasterization` in their place."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from room2dgs.splat import rasterization

WIDTH, HEIGHT, COUNT, SH_DEGREE = 32, 24, 80, 2
Splats = dict[str, torch.nn.Parameter]


@pytest.fixture
def cameras(make_view) -> tuple[Tensor, Tensor]:
    """camtoworlds (4, 4, 4) and Ks (4, 3, 3), as its dataset gives them."""
    views = [make_view(angle=angle) for angle in (-0.3, -0.1, 0.1, 0.3)]
    poses = torch.stack([torch.linalg.inv(pose.double()) for _, pose in views]).float()
    return poses, torch.stack([K for K, _ in views]) * torch.tensor([[0.8], [0.8], [1.0]])


@pytest.fixture
def splats(make_surfels) -> Splats:
    """Raw parameters under its names."""
    s = make_surfels(COUNT, 5)
    scales = torch.cat([s.scales, s.scales[:, :1]], dim=1)
    raw = {
        "means": s.centers, "scales": scales.log(), "quats": s.rotations, "opacities": torch.logit(s.opacities),
        "sh0": s.sh[:, :1], "shN": torch.zeros(COUNT, (SH_DEGREE + 1) ** 2 - 1, 3),
    }  # fmt: skip
    return {name: torch.nn.Parameter(value.clone()) for name, value in raw.items()}


def rasterize_splats(splats: Splats, camtoworlds: Tensor, Ks: Tensor, masks: Tensor | None = None, **kwargs: Any):
    """`Runner.rasterize_splats`: the same arguments, all of them by name."""
    given: dict[str, Any] = {
        "colors": torch.cat([splats["sh0"], splats["shN"]], 1), "packed": False, "absgrad": False,
        "sparse_grad": False, "rasterize_mode": "classic", "camera_model": "pinhole", **kwargs,
    }  # fmt: skip
    render_colors, render_alphas, info = rasterization(
        means=splats["means"], quats=splats["quats"], scales=torch.exp(splats["scales"]),
        opacities=torch.sigmoid(splats["opacities"]), viewmats=torch.linalg.inv_ex(camtoworlds).inverse, Ks=Ks,
        width=WIDTH, height=HEIGHT, distributed=False, with_ut=False, with_eval3d=False, ftheta_coeffs=None,
        radial_coeffs=None, tangential_coeffs=None, thin_prism_coeffs=None, **given,
    )  # fmt: skip
    if masks is not None:
        render_colors[~masks] = 0
    return render_colors, render_alphas, info


def gathered(info: dict[str, Any], packed: bool) -> tuple[Tensor, Tensor, Tensor]:
    """`DefaultStrategy._update_state`: sums of gradients, counts and largest radii of each Gaussian."""
    grads = info["means2d"].grad.clone()
    grads[..., 0] *= info["width"] / 2.0 * info["n_cameras"]
    grads[..., 1] *= info["height"] / 2.0 * info["n_cameras"]
    if packed:
        ids, radii = info["gaussian_ids"], info["radii"].max(dim=-1).values
    else:
        seen = (info["radii"] > 0.0).all(dim=-1)
        ids, radii, grads = torch.where(seen)[1], info["radii"][seen].max(dim=-1).values, grads[seen]
    sums, counts, largest = torch.zeros(COUNT), torch.zeros(COUNT), torch.zeros(COUNT)
    sums.index_add_(0, ids, grads.norm(dim=-1))
    counts.index_add_(0, ids, torch.ones_like(ids, dtype=torch.float32))
    largest[ids] = torch.maximum(largest[ids], radii / float(max(info["width"], info["height"])))
    return sums, counts, largest


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"packed": True, "render_mode": "RGB+ED"},
        {"packed": True, "sparse_grad": True},
        {"rasterize_mode": "antialiased"},
    ],
)
def test_its_loop_learns_a_scene_from_photos(splats, cameras, options):
    poses, Ks = cameras
    packed = options.get("packed", False)
    with torch.no_grad():
        truth, opaque, _ = rasterize_splats(splats, poses, Ks, sh_degree=0)
        seen = rasterize_splats(splats, poses, Ks, sh_degree=0)[2]["radii"].all(-1).any(0)
        splats["sh0"].mul_(0.3)
        splats["means"].add_(0.01)
    rates = {"means": 2e-3, "scales": 5e-3, "quats": 1e-3, "opacities": 5e-2, "sh0": 5e-2, "shN": 1e-3}
    kind = torch.optim.SparseAdam if options.get("sparse_grad") else torch.optim.Adam
    optimizers = {name: kind([value], lr=rates[name]) for name, value in splats.items()}
    errors, sums = [], torch.zeros(COUNT)
    for step in range(48):
        one = slice(step % 4, step % 4 + 1)
        renders, alphas, info = rasterize_splats(
            splats,
            poses[one],
            Ks[one],
            sh_degree=min(step // 16, SH_DEGREE),
            near_plane=0.01,
            far_plane=1e10,
            **options,
        )
        assert renders.shape == (1, HEIGHT, WIDTH, 4 if "render_mode" in options else 3)
        behind = torch.rand(1, 3)  # its random background
        colors = renders[..., :3] + behind * (1.0 - alphas)
        info["means2d"].retain_grad()
        loss = (colors - truth[one] - behind * (1.0 - opaque[one])).abs().mean()
        loss.backward()
        sums += gathered(info, packed)[0]
        if options.get("sparse_grad"):
            ids = info["gaussian_ids"]
            for value in splats.values():
                assert not value.grad.is_sparse
                dense = value.grad
                value.grad = torch.sparse_coo_tensor(
                    ids[None], dense[ids], value.size(), is_coalesced=True, check_invariants=True
                )
                torch.testing.assert_close(value.grad.to_dense(), dense)  # nothing outside what is listed
        for optimizer in optimizers.values():
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        errors.append(loss.item())
    assert sum(errors[-4:]) < 0.35 * sum(errors[:4])
    assert (sums > 0).sum() > 0.5 * seen.sum() and not sums[~seen].any()


def test_packed_or_not_its_strategy_gathers_the_same(splats, cameras):
    poses, Ks = cameras
    found = []
    for packed in (False, True):
        colors, _, info = rasterize_splats(splats, poses, Ks, sh_degree=0, packed=packed)
        info["means2d"].retain_grad()
        colors.square().mean().backward()
        visible = torch.zeros(COUNT, dtype=torch.bool)  # its visible_adam
        if packed:
            visible.scatter_(0, info["gaussian_ids"], True)
        else:
            visible = (info["radii"] > 0).all(-1).any(0)
        found.append((*gathered(info, packed), visible))
    for dense, sparse in zip(*found, strict=True):
        torch.testing.assert_close(dense, sparse)
    sums, counts, largest, visible = found[0]
    assert counts.max() == 4 and torch.equal(visible, counts > 0) and (largest[visible] > 0).all() and sums.any()


def test_masks_cut_out_of_the_picture_and_of_the_gradient(splats, cameras):
    poses, Ks = cameras
    masks = torch.ones(1, HEIGHT, WIDTH, dtype=torch.bool)
    masks[:, :, WIDTH // 2 :] = False
    colors, _, _ = rasterize_splats(splats, poses[:1], Ks[:1], masks, sh_degree=0)
    assert not colors[~masks].any() and colors[masks].any()
    colors[:, :, WIDTH // 2 :].sum().backward()
    assert not any(value.grad.any() for value in splats.values() if value.grad is not None)


def test_colours_of_an_appearance_module_and_poses_that_learn(splats, cameras):
    poses, Ks = cameras
    logits = torch.zeros(2, COUNT, 3, requires_grad=True)  # AppearanceOptModule: one set a camera
    shift = torch.zeros(2, 3, requires_grad=True)  # CameraOptModule
    moved = torch.cat([poses[:2, :3, :3], (poses[:2, :3, 3] + shift)[..., None]], -1)
    moved = torch.cat([moved, torch.tensor([[[0.0, 0, 0, 1]]]).expand(2, 1, 4)], 1)
    colors, alphas, _ = rasterize_splats(splats, moved, Ks[:2], colors=torch.sigmoid(logits))
    grey, _, _ = rasterize_splats(
        splats, poses[:2], Ks[:2], colors=torch.zeros(COUNT, 1, 3), sh_degree=0
    )  # coefficients of zero are the grey that logits of zero are
    torch.testing.assert_close(colors, grey, atol=1e-5, rtol=0)
    torch.testing.assert_close(colors, 0.5 * alphas.expand_as(colors), atol=1e-5, rtol=0)
    colors[0].square().sum().backward()
    assert logits.grad[0].any() and not logits.grad[1].any()
    assert shift.grad[0].abs().min() > 0 and not shift.grad[1].any()


def test_its_viewer_draws_every_mode(splats, cameras):
    poses, Ks = cameras
    view = {
        "near_plane": 0.01, "far_plane": 1e10, "radius_clip": 0.0, "eps2d": 0.3, "sh_degree": SH_DEGREE,
        "backgrounds": torch.tensor([[0.0, 128.0, 255.0]]) / 255.0, "packed": False,
    }  # fmt: skip
    with torch.no_grad():
        for mode, channels in (("RGB", 3), ("D", 1), ("ED", 1)):
            colors, alphas, info = rasterize_splats(splats, poses[:1], Ks[:1], render_mode=mode, **view)
            assert colors.shape == (1, HEIGHT, WIDTH, channels) and alphas.shape == (1, HEIGHT, WIDTH, 1)
            assert 0 < (info["radii"] > 0).all(-1).sum().item() <= COUNT and not colors.requires_grad
        empty = rasterize_splats(splats, poses[:1], Ks[:1], **{**view, "far_plane": 0.02})[0]
    assert torch.equal(empty[0], view["backgrounds"].expand(HEIGHT, WIDTH, 3))
