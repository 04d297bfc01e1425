"""The depth prior's loss: what it ignores, what it measures, and that nothing makes it singular."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.losses.depth_prior import MIN_PIXELS, depth_prior_loss, edge_band, scale_and_shift

H, W = 14, 17


def maps(seed=0):
    """(depth, alpha, prior, valid) in float64: a prior that resembles the depth; some pixels do not count."""
    g = torch.Generator().manual_seed(seed)
    depth = 1 + 3 * torch.rand(H, W, generator=g, dtype=torch.float64)
    prior = 0.4 * depth + 0.3 + 0.2 * torch.rand(H, W, generator=g, dtype=torch.float64)
    alpha = 0.3 + 0.7 * torch.rand(H, W, generator=g, dtype=torch.float64)
    return depth, alpha, prior, torch.rand(H, W, generator=g) > 0.1


def weights():
    return torch.rand(H, W, generator=torch.Generator().manual_seed(7), dtype=torch.float64)


def everything(depth, prior, **options):
    return depth_prior_loss(depth, torch.ones_like(depth), prior, torch.ones(depth.shape, dtype=torch.bool), **options)


def value_and_gradient(depth, *others, **options):
    leaf = depth.clone().requires_grad_()
    value = depth_prior_loss(leaf, *others, **options)
    value.backward()
    return value.item(), leaf.grad


def ramp(slope=0.1):
    """Depth 2 + slope * column."""
    return (2 + slope * torch.arange(W, dtype=torch.float64)).expand(H, W).clone()


@pytest.mark.parametrize("space", ["depth", "disparity"])
def test_neither_scale_nor_shift_of_the_prior_matters(space):
    depth, alpha, prior, valid = maps()
    prior = 1 / prior if space == "disparity" else prior
    wanted, gradient = value_and_gradient(depth, alpha, prior, valid, space=space)
    assert wanted > 1e-3
    for scale, shift in [(1000.0, 0.0), (0.01, 5.0), (3.0, 0.5)]:
        value, other = value_and_gradient(depth, alpha, scale * prior + shift, valid, space=space)
        assert value == pytest.approx(wanted, rel=1e-9)
        torch.testing.assert_close(other, gradient, rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("space", ["depth", "disparity"])
@pytest.mark.parametrize("align", [True, False])
def test_the_unit_of_length_does_not_matter(space, align):
    depth, alpha, prior, valid = maps()
    factor = 1000.0 if space == "depth" else 1e-3
    prior = prior if space == "depth" else 1 / prior
    value, gradient = value_and_gradient(depth, alpha, prior, valid, space=space, align=align)
    other, smaller = value_and_gradient(1000 * depth, alpha, factor * prior, valid, space=space, align=align)
    assert other == pytest.approx(value, rel=1e-12)
    torch.testing.assert_close(1000 * smaller, gradient, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("space", ["depth", "disparity"])
def test_a_prior_that_is_right_up_to_scale_and_shift_costs_nothing(space):
    depth = ramp()
    prior = 0.2 * (depth if space == "depth" else 1 / depth) + 0.7
    assert everything(depth, prior, space=space).item() < 1e-13
    assert everything(depth, prior, space=space, align=False).item() > 0.01


def test_metric_prior_known_values():
    """Residual 0.1 x column - 0.3 over a prior of 2: the mean square, and 0.05, 0.1, 0.2, 0.4 at the strides."""
    depth = ramp(0.1) - 0.3
    prior = torch.full((H, W), 2.0, dtype=torch.float64)
    residual = (0.1 * np.arange(W) - 0.3) / 2
    square = np.mean(residual**2)
    assert everything(depth, prior, align=False, gradient_weight=0).item() == pytest.approx(square)
    for scales, slopes in [(1, 0.05), (2, 0.15), (4, 0.75)]:
        value = everything(depth, prior, align=False, gradient_weight=0.5, scales=scales).item()
        assert value == pytest.approx(square + 0.5 * slopes)
    # rows count as columns do
    assert everything(depth.T, prior.T, align=False).item() == pytest.approx(square + 0.5 * 0.75)


def test_fit_equals_numpys_least_squares_over_the_compared_pixels():
    depth, alpha, prior, valid = maps()
    kept = valid & (alpha >= 0.5)
    scale, shift = np.polyfit(prior[kept].numpy(), depth[kept].numpy(), 1)
    hidden = torch.where(kept, prior, 1e6)
    assert scale_and_shift(hidden, torch.where(kept, depth, -1e6), kept) == pytest.approx((scale, shift), rel=1e-9)
    residual = (depth - scale * prior - shift)[kept] / (scale * prior + shift)[kept].mean()
    value = depth_prior_loss(depth, alpha, hidden, valid, gradient_weight=0).item()
    assert value == pytest.approx((residual**2).mean().item(), rel=1e-9)


@pytest.mark.parametrize("space", ["depth", "disparity"])
def test_gradcheck(space):
    depth, alpha, prior, valid = maps()
    prior = prior if space == "depth" else 1 / prior
    assert torch.autograd.gradcheck(
        lambda d: depth_prior_loss(d, alpha, prior, valid, space=space, align=False), depth.requires_grad_()
    )


@pytest.mark.parametrize("space", ["depth", "disparity"])
def test_gradcheck_with_weights(space):
    depth, alpha, prior, valid = maps()
    prior = prior if space == "depth" else 1 / prior
    assert torch.autograd.gradcheck(
        lambda d: depth_prior_loss(d, alpha, prior, valid, space=space, align=False, confidence=weights()),
        depth.requires_grad_(),
    )


def test_full_weight_everywhere_changes_no_bit():
    depth, alpha, prior, valid = (part.float() if part.is_floating_point() else part for part in maps())
    value, gradient = value_and_gradient(depth, alpha, prior, valid)
    weighted, other = value_and_gradient(depth, alpha, prior, valid, confidence=torch.ones(H, W))
    assert value == weighted and gradient.numpy().tobytes() == other.numpy().tobytes()


def test_doubt_everywhere_makes_the_term_small_and_doubt_in_places_leaves_those_out():
    depth, alpha, prior, valid = maps()
    value, gradient = value_and_gradient(depth, alpha, prior, valid)
    halved, half = value_and_gradient(depth, alpha, prior, valid, confidence=torch.full((H, W), 0.5))
    assert halved == pytest.approx(value / 2, rel=1e-12)
    torch.testing.assert_close(half, gradient / 2)
    # without a weight a pixel pulls no more than an invalid one, though it still counts in the mean
    weight = torch.ones(H, W, dtype=torch.float64)
    weight[3:8, 2:9] = 0
    wrong = torch.where(weight > 0, prior, 50.0)
    left_out, gradient = value_and_gradient(depth, alpha, wrong, valid, gradient_weight=0, confidence=weight)
    kept = valid & (alpha >= 0.5)
    share = torch.count_nonzero(kept & (weight > 0)) / torch.count_nonzero(kept)
    scale, shift = scale_and_shift(wrong, depth, kept * weight)
    # nor does it have a say in the unit: that is the mean of what was fitted
    residual = (depth - scale * wrong - shift)[kept & (weight > 0)] / depth[kept & (weight > 0)].mean()
    assert left_out == pytest.approx(float(share * residual.square().mean()), rel=1e-9)
    assert (gradient[weight == 0] == 0).all() and (gradient[kept & (weight > 0)] != 0).any()


def test_the_fit_counts_pixels_by_their_weight():
    depth, _, prior, _ = maps()
    weight = weights()
    wanted = np.polyfit(prior.numpy().ravel(), depth.numpy().ravel(), 1, w=weight.sqrt().numpy().ravel())
    assert scale_and_shift(prior, depth, weight) == pytest.approx(tuple(wanted), rel=1e-9)
    assert scale_and_shift(prior, depth, 0 * weight) == (1.0, 0.0)


def test_pixels_without_confidence_cannot_make_the_loss_large():
    """Where only the far half counts, s p + t is about -3.2 at the other one: its plain mean over all is near 0."""
    depth = ramp(0.1)
    prior = depth + 3.2 + 0.01 * torch.rand(H, W, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    weight = (torch.arange(W) >= W // 2).expand(H, W).double()
    confident = everything(depth, prior, confidence=weight, gradient_weight=0).item()
    elsewhere = torch.where(weight > 0, prior, 1e-3)
    scale, shift = scale_and_shift(elsewhere, depth, weight)
    assert everything(depth, elsewhere, confidence=weight, gradient_weight=0).item() == pytest.approx(confident)
    residual = (depth - scale * prior - shift)[weight > 0] / depth[weight > 0].mean()
    assert confident == pytest.approx((residual.square().sum() / (H * W)).item()) and confident < 1e-4


@settings(max_examples=60, deadline=None)
@given(
    depth_unit=st.floats(1e-4, 1e4),
    prior_unit=st.floats(1e-4, 1e4),
    seed=st.integers(0, 999),
    space=st.sampled_from(["depth", "disparity"]),
    noise=st.floats(0, 5),
    sure=st.floats(0.1, 1),
)
def test_no_unit_changes_the_loss_whatever_the_confidence(depth_unit, prior_unit, seed, space, noise, sure):
    g = torch.Generator().manual_seed(seed)
    depth, alpha, prior, valid = maps(seed)
    prior = prior + noise * torch.rand(H, W, generator=g, dtype=torch.float64)
    confidence = torch.rand(H, W, generator=g, dtype=torch.float64)
    confidence *= torch.rand(H, W, generator=g) < sure
    value, gradient = value_and_gradient(depth, alpha, prior, valid, space=space, confidence=confidence)
    other, smaller = value_and_gradient(
        depth_unit * depth, alpha, prior_unit * prior, valid, space=space, confidence=confidence
    )
    assert np.isfinite(value) and other == pytest.approx(value, rel=1e-8, abs=1e-20)
    torch.testing.assert_close(depth_unit * smaller, gradient, rtol=1e-6, atol=1e-12)


def test_no_weight_at_all_costs_nothing():
    depth, alpha, prior, valid = maps()
    value, gradient = value_and_gradient(depth, alpha, prior, valid, confidence=torch.zeros(H, W))
    assert value == 0 and (gradient == 0).all()


def test_scale_and_shift_are_held_constant_in_the_gradient():
    depth, alpha, prior, valid = maps()
    kept = valid & (alpha >= 0.5)
    scale, shift = scale_and_shift(prior, depth, kept)
    value, gradient = value_and_gradient(depth, alpha, prior, valid)
    fixed, wanted = value_and_gradient(depth, alpha, scale * prior + shift, valid, align=False)
    assert value == pytest.approx(fixed, rel=1e-12)
    torch.testing.assert_close(gradient, wanted, rtol=1e-9, atol=1e-15)


def test_pixels_that_do_not_count_have_no_say_and_no_gradient():
    depth, alpha, prior, valid = maps()
    depth[2, 3] = 0.0  # nothing rendered
    prior[4, 5] = 0.0
    prior[6, 7] = torch.nan
    prior[8, 9] = torch.inf
    valid[2:9, 3:10] = True
    alpha[2:9, 3:10] = 1.0
    counts = valid & (alpha >= 0.5) & (depth > 0) & (prior > 0) & torch.isfinite(prior)
    for space in ("depth", "disparity"):
        value, gradient = value_and_gradient(depth, alpha, prior, valid, space=space)
        assert torch.isfinite(gradient).all() and (gradient[~counts] == 0).all() and (gradient[counts] != 0).any()
        garbage = torch.where(counts, prior, torch.nan)
        assert value_and_gradient(torch.where(counts, depth, -7.0), alpha, garbage, valid, space=space)[0] == value


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("space", ["depth", "disparity"])
def test_flat_maps_are_not_singular(dtype, space):
    flat, slope = torch.full((H, W), 2.7, dtype=dtype), ramp().to(dtype)
    cases = {"both flat": (flat, flat / 3), "rendering flat": (flat, slope), "prior flat": (slope, flat)}
    for name, (depth, prior) in cases.items():
        value, gradient = value_and_gradient(depth, torch.ones_like(depth), prior, torch.ones(H, W).bool(), space=space)
        assert np.isfinite(value) and torch.isfinite(gradient).all()
        # a flat rendering of a room that is not flat has something to correct
        assert (value < 1e-10) == (name == "both flat")


def test_a_flat_rendering_is_tilted_towards_the_prior():
    depth = torch.full((H, W), 3.0, dtype=torch.float64)
    ones = torch.ones(H, W)
    _, gradient = value_and_gradient(depth, ones, ramp(), ones.bool(), gradient_weight=0)
    assert (gradient[:, 0] > 0).all() and (gradient[:, -1] < 0).all()


def test_the_scale_is_never_negative():
    prior = ramp()
    upside_down = 6 - prior
    compared = torch.ones(H, W, dtype=torch.bool)
    scale, shift = scale_and_shift(prior, upside_down, compared)
    assert scale == pytest.approx(upside_down.mean() / prior.mean()) and shift == 0


def test_too_few_pixels_cost_nothing():
    depth, prior, ones = ramp(), ramp().flip(1), torch.ones(H, W)
    valid = torch.zeros(H * W, dtype=torch.bool)
    valid[: MIN_PIXELS - 1] = True
    value, gradient = value_and_gradient(depth, ones, prior, valid.view(H, W))
    assert value == 0 and (gradient == 0).all()
    valid[MIN_PIXELS - 1] = True
    assert value_and_gradient(depth, ones, prior, valid.view(H, W))[0] > 0


def test_unknown_space_and_other_sizes_are_refused():
    depth, alpha, prior, valid = maps()
    with pytest.raises(ValueError, match="depth or disparity"):
        depth_prior_loss(depth, alpha, prior, valid, space="log")
    with pytest.raises(ValueError, match="differ in size"):
        depth_prior_loss(depth, alpha, prior[1:], valid)
    with pytest.raises(ValueError, match="differ in size"):
        depth_prior_loss(depth, alpha, prior, valid, confidence=weights()[1:])


def plane_depth(tilt, height=40, width=50, f=40.0):
    """z-depth of the plane through (0, 0, 2) with a normal `tilt` degrees off the optical axis."""
    y, x = np.mgrid[:height, :width] + 0.5
    t = np.radians(tilt)
    facing = np.cos(t) + np.sin(t) * (0.6 * (x - width / 2) + 0.8 * (y - height / 2)) / f
    return np.where(facing > 0.01, 2 * np.cos(t) / np.maximum(facing, 0.01), 0)


@pytest.mark.parametrize("tilt", [0, 30, 60, 80])
def test_a_plane_has_no_edge_however_slanted(tilt):
    assert not edge_band(plane_depth(tilt).astype(np.float32), 0.01, 2).any()


@pytest.mark.parametrize("transposed", [False, True])
def test_a_step_is_marked_on_both_sides_to_the_width(transposed):
    depth = np.full((12, 30), 2.0)
    depth[:, 15:] = 2.3
    marked = edge_band(depth.T if transposed else depth, 0.1, 3)
    marked = marked.T if transposed else marked
    assert (marked == marked[0]).all()
    # columns 14 and 15 lie beside the step
    np.testing.assert_array_equal(np.flatnonzero(marked[0]), np.arange(14 - 3, 15 + 3 + 1))
    assert not edge_band(depth, 0.16, 3).any()


def test_holes_are_not_edges():
    depth = np.full((12, 30), 2.0)
    depth[5, 5], depth[6, 20] = 0, np.nan
    assert not edge_band(depth, 0.05, 2).any()
