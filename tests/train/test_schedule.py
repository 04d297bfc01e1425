import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.config import RatesConfig, RenderConfig, ResolutionConfig, TermConfig
from room2dgs.errors import InputError
from room2dgs.train.schedule import (
    active_sh_degree,
    center_rate,
    image_fraction,
    is_active,
    learning_rates,
    view_index,
)

RATES = RatesConfig(center=1.6e-4, center_final=1.6e-6, rotation=1e-3, scale=5e-3, opacity=0.05, color=2.5e-3)


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
    frozen = RatesConfig(0.0, 0.0, 1e-3, 5e-3, 0.05, 2.5e-3)
    assert [center_rate(i, 10, frozen, 3.0) for i in (0, 9)] == [0.0, 0.0]


def test_a_final_rate_of_zero_is_refused(configure):
    with pytest.raises(InputError, match=r"train\.rates\.center_final"):
        configure("train.rates.center_final=0")


def test_other_rates_do_not_scale_with_the_scene_and_higher_harmonics_learn_at_a_twentieth():
    rates = learning_rates(3, 10, RATES, 7.0)
    assert rates["sh_rest"] == pytest.approx(rates["sh_dc"] / 20)
    assert (rates["rotations"], rates["log_scales"], rates["opacity_logits"]) == (1e-3, 5e-3, 0.05)


def test_sh_degree_rises_at_its_iterations_and_stops_at_the_top():
    render = RenderConfig(sh_degree=2, sh_every=10, near_m=0.05, background=[0, 0, 0], threads=None)
    assert [active_sh_degree(i, render) for i in (0, 9, 10, 19, 20, 1000)] == [0, 0, 1, 1, 2, 2]


def test_resolution_changes_exactly_at_until():
    levels = [ResolutionConfig(0.25, 10), ResolutionConfig(0.5, 20)]
    assert [image_fraction(i, levels) for i in (0, 9, 10, 19, 20)] == [0.25, 0.25, 0.5, 0.5, 1.0]
    assert image_fraction(0, []) == 1.0


def test_term_acts_from_its_first_iteration_if_enabled_and_weighted():
    assert [is_active(i, TermConfig(True, 0.1, 5)) for i in (4, 5)] == [False, True]
    assert not is_active(9, TermConfig(False, 0.1, 5))
    assert not is_active(9, TermConfig(True, 0.0, 5))


@given(st.integers(1, 40), st.integers(0, 2**31), st.integers(0, 5))
def test_every_epoch_sees_every_view_once(views, seed, epoch):
    seen = [view_index(epoch * views + i, views, seed) for i in range(views)]
    assert sorted(seen) == list(range(views))


def test_order_differs_between_epochs_and_seeds():
    def order(seed, epoch):
        return [view_index(epoch * 30 + i, 30, seed) for i in range(30)]

    assert order(0, 0) != order(0, 1)
    assert order(0, 0) != order(1, 0)
