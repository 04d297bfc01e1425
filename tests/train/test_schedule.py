from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from room2dgs import splat
from room2dgs.config import NormalReweightingConfig, RatesConfig, RenderConfig, ResolutionConfig, TermConfig
from room2dgs.errors import InputError
from room2dgs.primitives.spawned import Spawned
from room2dgs.primitives.surfel2d import Surfel2D
from room2dgs.seeds.decoders.explicit import explicit_decoder
from room2dgs.seeds.decoders.shared import shared_decoder
from room2dgs.train import train as train_run
from room2dgs.train.schedule import (
    active_sh_degree,
    at_iteration,
    center_rate,
    has_shares,
    image_fraction,
    opacity_floor,
    rates_at,
    reweighting_deg,
    term_weight,
    view_index,
)

RATES = RatesConfig(
    center=1.6e-4,
    center_final=1.6e-6,
    rotation=1e-3,
    scale=5e-3,
    opacity=0.05,
    color=2.5e-3,
    feature=7.5e-3,
    network=2e-3,
    network_final=2e-4,
    pose_rotation=3e-4,
    pose_center=3e-4,
)


def spawned() -> Spawned:
    zeros, ones = torch.zeros(1, 2, 3), torch.ones(1, 2)
    return Spawned(zeros[:, 0], zeros, torch.ones(1, 2, 4), torch.ones(1, 2, 2), 0.5 * ones, zeros)


def test_center_rate_goes_from_first_to_final_through_the_geometric_mean():
    rates = [center_rate(i, 101, RATES, 2.5) for i in (0, 50, 100)]
    assert rates == pytest.approx([4e-4, 4e-5, 4e-6])


def test_center_rate_beyond_the_end_of_a_shortened_run_stays_final():
    assert center_rate(500, 101, RATES, 1.0) == pytest.approx(1.6e-6)


def test_a_single_iteration_has_the_first_rate():
    assert center_rate(0, 1, RATES, 1.0) == pytest.approx(1.6e-4)


def test_cameras_that_only_turn_still_move_centres():
    assert center_rate(0, 10, RATES, 0.0) == pytest.approx(1.6e-5)


def test_zero_centre_rate_freezes_the_centres():
    frozen = replace(RATES, center=0.0, center_final=0.0)
    assert [center_rate(i, 10, frozen, 3.0) for i in (0, 9)] == [0.0, 0.0]


@pytest.mark.parametrize("rate", ["center", "network"])
def test_a_final_rate_of_zero_is_refused(configure, rate):
    with pytest.raises(InputError, match=rf"train\.rates\.{rate}_final"):
        configure(f"train.rates.{rate}_final=0")


def test_every_layer_of_the_network_learns_at_a_falling_rate():
    first, last = (rates_at(i, 101, RATES, 2.5) for i in (0, 100))
    assert (first.network, last.network) == pytest.approx((2e-3, 2e-4))
    assert first.feature == last.feature == 7.5e-3
    decoder = shared_decoder(spawned(), Surfel2D(), 8, 0)
    rates = decoder.learning_rates(last)
    assert set(decoder.parameters()) <= set(rates)
    assert {name for name, rate in rates.items() if rate == last.network} == {
        "hidden_weight", "hidden_bias", "out_weight", "out_bias",
    }  # fmt: skip
    assert rates["features"] == 7.5e-3 and rates["offsets"] == last.center


def test_other_rates_do_not_scale_with_the_scene_and_higher_harmonics_learn_at_a_twentieth():
    decoder = explicit_decoder(spawned(), Surfel2D(), 1)
    rates = decoder.learning_rates(rates_at(3, 10, RATES, 7.0))
    assert set(decoder.parameters()) == set(rates)
    assert rates["sh_rest"] == pytest.approx(rates["sh_dc"] / 20)
    assert (rates["rotations"], rates["raw_scales"], rates["opacity_logits"]) == (1e-3, 5e-3, 0.05)


def test_sh_degree_rises_at_its_iterations_and_stops_at_the_top():
    render = RenderConfig(sh_degree=2, sh_every=10, near_m=0.05, background=[0, 0, 0], threads=None, device="cpu")
    assert [active_sh_degree(i, render) for i in (0, 9, 10, 19, 20, 1000)] == [0, 0, 1, 1, 2, 2]


def test_resolution_changes_exactly_at_until(configure):
    train = configure("train.iterations=40", "train.coarsest_px=1").train
    train = replace(train, resolutions=[ResolutionConfig(0.25, 10), ResolutionConfig(0.5, 0.5)])
    assert [image_fraction(i, train, 640) for i in (0, 9, 10, 19, 20)] == [0.25, 0.25, 0.5, 0.5, 1.0]
    assert image_fraction(0, replace(train, resolutions=[]), 640) == 1.0


def test_a_run_whose_photo_size_changes_at_a_share_of_it_depends_on_its_length(configure):
    level, whole = "train.resolutions=[{{fraction: 0.5, until: {}}}]", "train.opacity_floor.until=4"
    assert has_shares(configure(level.format(0.5), whole)) and not has_shares(configure(level.format(4), whole))
    assert has_shares(configure(level.format(4), "train.opacity_floor.until=0.5"))


def test_hits_are_skipped_by_training_s_floor_until_its_time_and_then_by_the_renderer_s(configure):
    train = configure("train.iterations=40", "train.opacity_floor={value: 0.1, until: 0.5}").train
    assert [opacity_floor(i, train) for i in (0, 19, 20, 39)] == [0.1, 0.1, 1 / 255, 1 / 255]


def test_training_draws_with_the_floor_of_its_iteration(capture, configure, log, tmp_path, monkeypatch):
    floors = []
    render = splat.render
    monkeypatch.setattr(splat, "render", lambda *a, **o: floors.append(o["opacity_floor"]) or render(*a, **o))
    settings = ["train.iterations=4", "train.opacity_floor={value: 0.1, until: 2}", "train.test_every=0"]
    train_run(*capture, configure(*settings), tmp_path / "run", log)
    assert floors[:4] == [0.1, 0.1, 1 / 255, 1 / 255]


@pytest.mark.parametrize("width, fraction", [(1280, 0.5), (640, 0.5), (480, 2 / 3), (320, 1.0), (160, 1.0)])
def test_small_photos_are_hardly_made_smaller_and_none_larger(configure, width, fraction):
    train = configure("train.resolutions=[{fraction:0.5,until:0.5}]", "train.coarsest_px=320").train
    assert image_fraction(0, train, width) == pytest.approx(fraction)


def term(**changes) -> TermConfig:
    return TermConfig(**({"enabled": True, "weight": 0.1, "start": 5, "end": None, "ramp": 0} | changes))


def test_term_acts_from_its_first_iteration_if_enabled_and_weighted():
    assert [term_weight(i, term(), 100) for i in (4, 5, 99)] == [0, 0.1, 0.1]
    assert term_weight(9, term(enabled=False), 100) == 0
    assert term_weight(9, term(weight=0.0), 100) == 0


def test_term_ends_before_its_end():
    assert [term_weight(i, term(end=8), 100) for i in (5, 7, 8, 9)] == [0.1, 0.1, 0, 0]


def test_ramp_rises_in_equal_steps_from_above_zero_to_the_full_weight():
    weights = [term_weight(i, term(ramp=4, weight=1.0), 100) for i in range(4, 11)]
    assert weights == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0])


def test_floats_are_shares_of_the_run_and_ints_are_iterations():
    shares = term(start=0.25, end=0.5, ramp=0.1, weight=1.0)
    assert [term_weight(i, shares, 40) for i in (9, 10, 12, 14, 19, 20)] == pytest.approx([0, 0.2, 0.6, 1, 1, 0])
    assert [at_iteration(time, 200) for time in (0, 0.25, 0.999, 1, 1.0, 150, 300)] == [0, 50, 200, 1, 200, 150, 300]


@given(share=st.floats(0, 1), iteration=st.integers(0, 100_000), iterations=st.integers(1, 100_000))
def test_a_share_lies_within_the_run_and_an_iteration_is_itself(share, iteration, iterations):
    assert 0 <= at_iteration(share, iterations) <= iterations
    assert at_iteration(iteration, iterations) == iteration
    assert abs(at_iteration(share, iterations) - share * iterations) <= 0.5


def test_a_whole_share_is_the_whole_run_and_one_is_an_iteration():
    acts = [[term_weight(i, term(start=0, end=end), 10) > 0 for i in range(10)] for end in (1.0, 1, 0.1)]
    assert acts == [[True] * 10, [True] + [False] * 9, [True] + [False] * 9]
    assert not any(term_weight(i, term(start=1.0), 10) for i in range(10))


@given(st.integers(1, 40), st.integers(0, 2**31), st.integers(0, 5))
def test_every_epoch_sees_every_view_once(views, seed, epoch):
    seen = [view_index(epoch * views + i, views, seed) for i in range(views)]
    assert sorted(seen) == list(range(views))


def test_order_differs_between_epochs_and_seeds():
    def order(seed, epoch):
        return [view_index(epoch * 30 + i, 30, seed) for i in range(30)]

    assert order(0, 0) != order(0, 1)
    assert order(0, 0) != order(1, 0)


def test_reweighting_narrows_from_its_start_to_the_last_iteration():
    settings = NormalReweightingConfig(enabled=True, start=0.4, first_deg=80.0, last_deg=20.0)
    assert [reweighting_deg(i, settings, 101) for i in (0, 39)] == [None, None]
    assert [reweighting_deg(i, settings, 101) for i in (40, 70, 100)] == pytest.approx([80, 40, 20])
    assert reweighting_deg(100, replace(settings, enabled=False), 101) is None
    assert reweighting_deg(100, replace(settings, start=101), 101) is None
