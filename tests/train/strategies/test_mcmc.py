"""The strategy of 3DGS-MCMC: what moves, what it keeps of the picture, and where noise acts."""

from __future__ import annotations

import pytest
import torch

from room2dgs.primitives.registry import new_primitive
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.registry import new_decoder
from room2dgs.train.model import Model, make_adam
from room2dgs.train.strategies.mcmc import SHARED_MOST, McmcStrategy, shared_by


@pytest.fixture
def mcmc(configure):
    """A call gives a strategy and a model of primitives 1 m apart, with these opacities."""

    def make(opacities, *settings, primitive="gaussian3d"):
        window = ["train.iterations=100", "strategy.every=10", "strategy.start=10", "strategy.stop=50"]
        config = configure("strategy=mcmc", "seeds.per_seed=1", f"primitive={primitive}", *window, *settings)
        count = len(opacities)
        spawned = Spawned(
            positions=torch.arange(float(count))[:, None] * torch.tensor([1.0, 0, 0]),
            offsets=torch.zeros(count, 1, 3),
            rotations=torch.tensor([0.8, 0.6, 0.0, 0.0]).repeat(count, 1, 1),
            scales=torch.tensor([[[0.02, 0.01]]]).repeat(count, 1, 1),
            opacities=torch.tensor(opacities)[:, None],
            sh_dc=torch.zeros(count, 1, 3),
        )
        decoder = new_decoder(spawned, new_primitive(config), config.seeds, 0, 0)
        return McmcStrategy(config, 2.0), Model(decoder, make_adam(decoder.parameters()), 10)

    return make


def test_transparent_ones_move_to_opaque_ones_and_the_number_grows_to_the_cap(mcmc):
    strategy, model = mcmc([0.9] * 30 + [0.001] * 10, "strategy.max_surfels=41", "train.rates.center=0")
    adjustment = strategy.after_step(model)
    assert adjustment.pruned == {"moved": 10} and adjustment.added == {"sampled": 1}
    splats = model.splats(0)
    assert model.count == 41 and (splats.opacities > 0.005).all()
    places, counts = splats.centers[:, 0].detach().round().unique(return_counts=True)
    assert set(places.tolist()) == set(map(float, range(30)))  # nobody is left where the transparent ones were
    alone = {float(place) for place, count in zip(places, counts, strict=True) if count == 1}
    for center, opacity, scales in zip(splats.centers, splats.opacities, splats.scales, strict=True):
        shared = float(center[0].round()) not in alone
        assert (float(opacity) < 0.89) is shared and (float(scales[0]) < 0.0199) is shared


@pytest.mark.parametrize("primitive", ["gaussian3d", "surfel2d"])
def test_noise_moves_transparent_ones_along_their_axes_by_their_covariance(mcmc, primitive):
    found = []
    for _ in range(2):
        strategy, model = mcmc([0.0051] * 3000 + [0.9] * 5, "strategy.prune_opacity=0.001", primitive=primitive)
        model.iteration = 15  # no adjustment is due
        before = model.splats(0)
        assert strategy.after_step(model) is None
        found.append((model.splats(0).centers - before.centers).detach())
    moved = found[0]
    assert torch.equal(*found)
    assert moved[:3000].any(dim=1).all() and moved[3000:].abs().max() < 1e-6 * moved.abs().max()
    along = moved[:3000] @ model.primitive.scale_axes(before)[0].T
    spread = along.std(dim=0) / model.primitive.axis_scales(before)[0].square()
    torch.testing.assert_close(spread / spread[0], torch.ones_like(spread), rtol=0.06, atol=0)


def test_costs_pull_opacities_and_scales_down(mcmc):
    strategy, model = mcmc([0.9] * 4)
    strategy.add_gradients(model)
    parameters = model.decoder.parameters()
    assert (parameters["opacity_logits"].grad > 0).all() and (parameters["raw_scales"].grad > 0).all()
    assert parameters["offsets"].grad is None


@pytest.mark.parametrize("count", [1, 2, 3, 7, 20])
@pytest.mark.parametrize("opacity", [0.02, 0.5, 0.95])
def test_several_in_one_place_look_as_one_did(opacity, count):
    """Their alpha together, integrated over the plane: 1 - (1 - a G)^n of the smaller ones equals a G of the one.

    Eq. 9 makes equal what a line through the centre holds.
    """
    each, factor = shared_by(torch.tensor([opacity], dtype=torch.float64), torch.tensor([count]))
    x = torch.linspace(-8, 8, 20001, dtype=torch.float64)
    one = opacity * torch.exp(-0.5 * x**2)
    together = 1 - (1 - each * torch.exp(-0.5 * (x / factor) ** 2)) ** count
    assert float(together.max()) == pytest.approx(opacity, rel=1e-6)
    assert float(together.sum()) == pytest.approx(float(one.sum()), rel=1e-6)
    assert float(factor) <= 1 + 1e-9


def test_one_alone_stays_as_it_is_and_crowds_are_held():
    opacities = torch.tensor([0.1, 0.7], dtype=torch.float64)
    each, factors = shared_by(opacities, torch.tensor([1, 1]))
    torch.testing.assert_close(each, opacities)
    torch.testing.assert_close(factors, torch.ones(2, dtype=torch.float64))
    crowd, most = (
        shared_by(opacities, torch.tensor([10**6, 10**6])),
        shared_by(opacities, torch.full((2,), SHARED_MOST)),
    )
    assert torch.equal(crowd[0], most[0]) and torch.isfinite(crowd[1]).all() and (crowd[1] > 0).all()
