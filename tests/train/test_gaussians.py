"""3D Gaussians through the trainer, and what they tell of the surface."""

from __future__ import annotations

import re

import numpy as np
import pytest
import torch

from room2dgs import splat
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.primitives.gaussian3d import FIRST_THICKNESS, Gaussian3D, MipGaussian3D, MipGaussians
from room2dgs.primitives.primitive import Rates
from room2dgs.primitives.registry import primitive_of, render
from room2dgs.primitives.spawned import Spawned
from room2dgs.splat import Gaussians
from room2dgs.train import load_surfels, train

K = torch.tensor([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]])


@pytest.fixture
def gaussians():
    g = torch.Generator().manual_seed(4)
    scales = torch.rand(12, 3, generator=g) + 0.1
    centers = torch.rand(12, 3, generator=g) + torch.tensor([0.0, 0.0, 2.0])
    return Gaussians(centers, torch.randn(12, 4, generator=g), scales, torch.full((12,), 0.5), torch.zeros(12, 1, 3))


def test_they_start_as_the_discs_with_some_thickness():
    g = torch.Generator().manual_seed(0)
    start = Spawned(
        torch.rand(2, 3, generator=g), torch.rand(2, 3, 3, generator=g), torch.randn(2, 3, 4, generator=g),
        torch.rand(2, 3, 2, generator=g) + 0.01, torch.rand(2, 3, generator=g), torch.rand(2, 3, 3, generator=g),
    )  # fmt: skip
    primitive = Gaussian3D()
    parameters = primitive.first_parameters(start, 8)
    assert tuple(parameters) == primitive.parameters == tuple(primitive.learning_rates(Rates(*range(7))))
    splats = primitive.activated(start.positions[:, None] + start.offsets, parameters, 2)
    assert type(splats) is Gaussians and splats.sh.shape == (6, 9, 3)
    torch.testing.assert_close(splats.scales[:, :2], start.scales.flatten(0, 1))
    torch.testing.assert_close(splats.scales[:, 2], FIRST_THICKNESS * splats.scales[:, :2].amin(dim=1))
    axes = rotation_matrices(start.rotations.flatten(0, 1))
    assert torch.equal(primitive.normals(splats), axes[:, :, 2])


def test_normal_footprint_and_disc_are_of_the_two_larger_axes(gaussians):
    """Whichever of the three is the smallest."""
    primitive = Gaussian3D()
    matrices = rotation_matrices(gaussians.rotations)
    discs = primitive.as_discs(gaussians)
    assert set(gaussians.scales.argmin(dim=1).tolist()) == {0, 1, 2}
    for k, scales in enumerate(gaussians.scales):
        thin = int(scales.argmin())
        torch.testing.assert_close(primitive.normals(gaussians)[k], matrices[k, :, thin])
        others = [(thin + 1) % 3, (thin + 2) % 3]
        torch.testing.assert_close(primitive.footprints(gaussians)[k], scales[others].prod().sqrt())
        turned = rotation_matrices(discs.rotations[k : k + 1])[0]
        torch.testing.assert_close(turned, matrices[k][:, [*others, thin]], atol=1e-5, rtol=0)
        torch.testing.assert_close(discs.scales[k], scales[others])


def test_children_spread_as_their_parent_does():
    count = 5000
    rotation = torch.tensor([[0.8, 0.6, 0.0, 0.0]]).repeat(count, 1)
    scales = torch.tensor([[0.3, 0.1, 0.02]]).repeat(count, 1)
    parents = Gaussians(torch.zeros(count, 3), rotation, scales, torch.ones(count), torch.ones(count, 1, 3))
    rows = Gaussian3D().children({"offsets": torch.zeros(count, 1, 3)}, parents, np.random.default_rng(0), 1.6)
    axes = rotation_matrices(rotation[:1])[0] * scales[0]
    torch.testing.assert_close(torch.cov(rows["offsets"][:, 0].T), axes @ axes.T, atol=4e-3, rtol=0)
    torch.testing.assert_close(rows["raw_scales"].exp()[0, 0], scales[0] / 1.6)


def test_each_kind_is_drawn_with_its_own_filter(gaussians):
    mip = MipGaussians(*gaussians._replace(scales=gaussians.scales * 0.02))
    assert isinstance(primitive_of(mip), MipGaussian3D) and isinstance(primitive_of(gaussians), Gaussian3D)
    drawn = render(mip, K, torch.eye(4), 32, 24)
    expected = splat.render_gaussians(Gaussians(*mip), K, torch.eye(4), 32, 24, antialias=True)
    assert torch.equal(drawn.color, expected.color) and drawn.alpha.max() > 0.01
    assert not torch.equal(drawn.alpha, render(Gaussians(*mip), K, torch.eye(4), 32, 24).alpha)


STRATEGIES = {
    "seeds": ["strategy=seeds", "strategy.min_visits=1", "strategy.grow_gradient=0", "strategy.thin=0.02"],
    "plain": [
        "strategy=plain", "seeds.per_seed=1", "strategy.grow_gradient=0", "strategy.split_size=0",
        "strategy.reset_every=4", "strategy.prune_opacity=0", "strategy.max_surfels=5000",
    ],
    "mcmc": ["strategy=mcmc", "seeds.per_seed=1", "strategy.prune_opacity=0.1"],
}  # fmt: skip


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("primitive", ["gaussian3d", "mip_gaussian3d"])
def test_they_train_grow_resume_to_the_same_bits_and_are_read_back(
    capture, configure, log, tmp_path, strategy, primitive
):
    settings = [
        f"primitive={primitive}", *STRATEGIES[strategy], "train.iterations=8", "strategy.every=2", "strategy.start=0",
        "strategy.stop=1.0", "train.checkpoint_every=4", "train.keep_checkpoints=2", "render.sh_degree=2",
        "render.sh_every=3", "seeds.scale_activation=softplus", "train.refine_poses=true",
    ]  # fmt: skip
    whole = train(*capture, configure(*settings), tmp_path / "whole", log)
    lines = "\n".join(log.lines)
    assert re.search(r"added \d+ \(", lines)
    assert strategy != "mcmc" or re.search(r"added \d+ \(sampled\)", lines)
    found = load_surfels(whole.surfels_path)
    assert type(found) is {"gaussian3d": Gaussians, "mip_gaussian3d": MipGaussians}[primitive]
    assert found.scales.shape == (whole.surfels, 3)
    (tmp_path / "whole/checkpoints/iteration_0000008.safetensors").unlink()
    again = train(*capture, configure(*settings, "resume=true"), tmp_path / "whole", log)
    assert all(torch.equal(a, b) for a, b in zip(found, load_surfels(again.surfels_path), strict=True))
