"""Clone, split and prune of single surfels, by hand."""

from types import SimpleNamespace

import pytest
import torch

from room2dgs.primitives.registry import new_primitive
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.registry import new_decoder
from room2dgs.train.model import Model, adam_state, make_adam, set_rates
from room2dgs.train.strategies.plain import PlainStrategy, resets
from room2dgs.train.strategies.screen_gradients import ScreenGradients
from room2dgs.train.strategies.strategy import Window

EXTENT_M = 2.0  # so small is up to 2 cm, oversized is beyond 20 cm
SMALL, LARGE, HUGE = 0.019, 0.021, 0.21
WIDTH, HEIGHT = 40, 30


def model_of(scales, opacities, config) -> Model:
    count = len(scales)
    spawned = Spawned(
        positions=torch.arange(3.0 * count).reshape(count, 3) / 1000,
        offsets=torch.full((count, 1, 3), 0.5),
        rotations=torch.tensor([0.8, 0.6, 0.0, 0.0]).repeat(count, 1, 1),  # turned about x: normal (0, -0.96, 0.28)
        scales=torch.tensor(scales)[:, None, None].repeat(1, 1, 2) * torch.tensor([1.0, 0.5]),
        opacities=torch.tensor(opacities)[:, None],
        sh_dc=torch.arange(3.0 * count).reshape(count, 1, 3) / 10,
    )
    decoder = new_decoder(spawned, new_primitive(config), config.seeds, 0, 0)
    model = Model(decoder, make_adam(decoder.parameters()), 10)
    for value in decoder.parameters().values():
        value.grad = torch.ones_like(value)
    set_rates(model.adam, dict.fromkeys(decoder.parameters(), 0.0))
    model.adam.step()
    return model


def adjusted(model: Model, gradients, config, pixels=10**6):
    """One adjustment after one iteration with these gradients, in 2DGS's units."""
    strategy = PlainStrategy(config, EXTENT_M, pixels)
    center_px = torch.tensor(gradients)[:, None] * torch.tensor([2 / WIDTH, 0.0])
    color = torch.zeros(HEIGHT, WIDTH, 3)
    opacities = torch.zeros(len(gradients))
    strategy.after_backward(SimpleNamespace(color=color, opacities=opacities, center_gradients=center_px))
    return strategy.after_step(model)


@pytest.fixture
def plain(configure):
    def build(*settings):
        window = ["train.iterations=100", "strategy.every=10", "strategy.start=10", "strategy.stop=50"]
        return configure("strategy=plain", "seeds.per_seed=1", *window, *settings)

    return build


def test_small_ones_are_cloned_and_large_ones_split_where_gradients_are_large(plain):
    config = plain()
    model = model_of([SMALL, SMALL, LARGE, LARGE], [0.5, 0.5, 0.5, 0.6], config)
    old = model.splats(0)
    moments = adam_state(model.adam)["exp_avg/offsets"].clone()
    adjustment = adjusted(model, [3e-4, 1e-4, 1e-4, 3e-4], config)
    assert adjustment.added == {"cloned": 1, "split": 1} and sum(adjustment.pruned.values()) == 0
    new = model.splats(0)
    # survivors 0, 1, 2; the clone of 0; two children of 3
    assert len(new.centers) == 6
    for before, after in zip(old, new, strict=True):
        assert torch.equal(after[:3], before[:3]) and torch.equal(after[3], before[0])
    torch.testing.assert_close(new.scales[4:], old.scales[3].repeat(2, 1) / 1.6)
    assert torch.equal(new.opacities[4:], old.opacities[3].repeat(2))
    assert torch.equal(new.sh[4:], old.sh[3].repeat(2, 1, 1))
    state = adam_state(model.adam)["exp_avg/offsets"]
    assert torch.equal(state[:3], moments[:3]) and (state[3:] == 0).all()


def test_children_lie_in_their_parents_plane_spread_like_its_gaussian(plain):
    config = plain()
    model = model_of([LARGE] * 2000, [0.5] * 2000, config)
    parents = model.splats(0).centers.repeat_interleave(2, dim=0)
    adjusted(model, [3e-4] * 2000, config)
    steps = (model.splats(0).centers - parents).detach()
    assert len(steps) == 4000
    normal, t_u, t_v = torch.tensor([[0.0, -0.96, 0.28], [1.0, 0.0, 0.0], [0.0, 0.28, 0.96]])
    assert (steps @ normal).abs().max() < 1e-5
    assert (steps @ t_u)[:400].std().item() == pytest.approx(LARGE, rel=0.1)
    assert (steps @ t_v)[:400].std().item() == pytest.approx(LARGE / 2, rel=0.1)


def test_faint_ones_go_and_oversized_ones_only_after_a_reset(plain):
    for reset_every, left in ((0, [0, 2]), (20, [0, 2]), (10, [0])):
        config = plain(f"strategy.reset_every={reset_every}")
        model = model_of([SMALL, SMALL, HUGE], [0.9, 0.049, 0.9], config)
        model.iteration = 20
        positions = model.decoder.fixed()["positions"]
        adjustment = adjusted(model, [0.0, 1.0, 0.0], config)
        assert torch.equal(model.decoder.fixed()["positions"], positions[left])
        assert adjustment.added == {"cloned": 0, "split": 0}
        assert adjustment.pruned == {"faint": 1, "large": 2 - len(left)}


def test_opacities_are_reset_at_adjustments_that_growth_goes_on_after():
    of_3dgs = Window(first=500, last=15000, every=100)  # in 30,000 iterations
    assert resets(of_3dgs, 3000) == (3000, 6000, 9000, 12000)
    assert resets(Window(501, 15000, 100), 3000) == (3001, 6001, 9001, 12001)
    assert resets(Window(117, 3500, 100), 3000) == ()  # in 7,000 growth would end 500 iterations later
    assert resets(Window(117, 6000, 100), 3000) == (3017,)
    assert resets(of_3dgs, 0) == ()
    assert resets(Window(10, 50, 10), 4) == (10, 20, 30, 40, 50)  # more often than adjustments: at each


def test_a_reset_leaves_no_opacity_above_a_hundredth_and_prunes_by_those_before_it(plain):
    config = plain("strategy.reset_every=20")
    model = model_of([SMALL, SMALL], [0.9, 0.06], config)
    model.iteration = 20
    adjustment = adjusted(model, [0.0, 0.0], config)
    assert adjustment.reset and adjustment.pruned == {"faint": 0, "large": 0}
    assert model.splats(0).opacities.max() <= 0.01 + 1e-6


@pytest.mark.parametrize(("settings", "pixels"), [(["strategy.max_surfels=6"], 10**6), ([], 6 * 16 + 15)])
def test_under_a_cap_the_largest_gradients_grow(plain, settings, pixels):
    """Of the settings, or one for so many pixels."""
    config = plain(*settings)
    model = model_of([SMALL] * 4, [0.5] * 4, config)
    centres = model.splats(0).centers
    adjusted(model, [3e-4, 5e-4, 4e-4, 2.5e-4], config, pixels)
    assert torch.equal(model.splats(0).centers[4:], centres[[1, 2]])


def test_if_all_were_to_go_none_does(plain):
    config = plain()
    model = model_of([SMALL] * 2, [0.01] * 2, config)
    adjusted(model, [0.0, 0.0], config)
    assert model.seeds == 2


def test_screen_gradients_are_in_2dgs_units_and_means_over_iterations_that_saw_the_surfel():
    gradients = ScreenGradients(3)
    gradients.add(torch.tensor([[3e-5, 0.0], [0.0, 4e-5], [0.0, 0.0]]), width=20, height=10)
    gradients.add(torch.tensor([[3e-5, -8e-5], [0.0, 0.0], [0.0, 0.0]]), width=20, height=10)
    torch.testing.assert_close(gradients.means(), torch.tensor([(3e-4 + 5e-4) / 2, 2e-4, 0.0]))
    assert gradients.visits.tolist() == [2, 1, 0]
    again = ScreenGradients.of(gradients.state())
    assert torch.equal(again.means(), gradients.means())
    again.add(torch.ones(3, 2), 2, 2)
    assert gradients.visits.tolist() == [2, 1, 0]  # not shared
