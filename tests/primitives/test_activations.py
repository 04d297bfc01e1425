import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.primitives.activations import (
    OPACITY_LOGIT_MAX,
    SCALE_MAX_M,
    SCALE_MIN_M,
    ScaleActivation,
    opacity_logit_of,
    opacity_of,
)

units = st.floats(1e-4, 10.0)
scales = st.floats(math.log(SCALE_MIN_M), math.log(SCALE_MAX_M)).map(math.exp)
names = st.sampled_from(["exp", "softplus"])


@settings(deadline=None)
@given(names, units, scales)
def test_scales_come_back_over_the_whole_range(name, unit_m, scale):
    activation = ScaleActivation(name, unit_m)
    for dtype, relative in ((torch.float64, 1e-12), (torch.float32, 4e-6)):
        metres = torch.tensor([scale], dtype=dtype).clamp(SCALE_MIN_M, SCALE_MAX_M)
        torch.testing.assert_close(
            activation.scale_of(activation.raw_of(metres)), metres, rtol=relative, atol=0, check_dtype=True
        )


@given(names, units, st.floats(-1e6, 1e6))
def test_constrained_scales_are_inside_the_bounds_and_keep_a_gradient(name, unit_m, raw):
    activation = ScaleActivation(name, unit_m)
    values = torch.tensor([raw])
    activation.constrain_(values)
    values.requires_grad_(True)
    metres = activation.scale_of(values)
    assert SCALE_MIN_M * (1 - 1e-5) <= metres.item() <= SCALE_MAX_M * (1 + 1e-5)
    metres.backward()
    assert values.grad.item() > 0


def test_scales_out_of_bounds_start_at_the_bound():
    for name in ("exp", "softplus"):
        activation = ScaleActivation(name, 0.02)
        metres = activation.scale_of(activation.raw_of(torch.tensor([0.0, 1e4], dtype=torch.float64)))
        assert metres.tolist() == pytest.approx([SCALE_MIN_M, SCALE_MAX_M])


def test_a_step_is_relative_under_exp_and_absolute_for_large_scales_under_softplus():
    large = torch.tensor([0.4, 0.8], dtype=torch.float64)
    exp, softplus = ScaleActivation("exp"), ScaleActivation("softplus", 0.02)
    growth = exp.scale_of(exp.raw_of(large) + 0.01) / large
    assert growth.tolist() == pytest.approx([math.exp(0.01)] * 2)
    added = softplus.scale_of(softplus.raw_of(large) + 0.01) - large
    assert added.tolist() == pytest.approx([0.02 * 0.01] * 2, rel=1e-6)


def test_small_scales_step_alike_under_both():
    small = torch.tensor([1e-4], dtype=torch.float64)
    grown = [
        activation.scale_of(activation.raw_of(small) + 0.01).item()
        for activation in (ScaleActivation("exp"), ScaleActivation("softplus", 0.02))
    ]
    assert grown[1] == pytest.approx(grown[0], rel=1e-4)


@given(st.floats(1e-5, 1 - 1e-5))
def test_opacities_come_back(opacity):
    value = torch.tensor([opacity], dtype=torch.float64)
    torch.testing.assert_close(opacity_of(opacity_logit_of(value)), value, rtol=1e-10, atol=0)


def test_opacities_of_zero_and_one_have_finite_logits():
    logits = opacity_logit_of(torch.tensor([0.0, 1.0]))
    assert logits.tolist() == [-OPACITY_LOGIT_MAX, OPACITY_LOGIT_MAX]
