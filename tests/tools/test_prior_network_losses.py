"""What the losses reward."""

import math

import pytest
import torch
from torch.nn import functional as F

from room2dgs.tools.prior_network.batches import Batch
from room2dgs.tools.prior_network.losses import Truth, depth_terms, losses, median_offset, normal_terms
from room2dgs.tools.prior_network.network import Maps
from room2dgs.tools.prior_network.validation import photo_scores


def example(seed: int = 0) -> tuple[Maps, Truth]:
    generator = torch.Generator().manual_seed(seed)
    shape = (2, 1, 16, 24)
    normal = F.normalize(torch.randn(2, 3, 16, 24, generator=generator), dim=1)
    other = F.normalize(normal + 0.2 * torch.randn(2, 3, 16, 24, generator=generator), dim=1)
    ln_depth = 0.3 * torch.randn(shape, generator=generator)
    depth = (ln_depth + 0.1 * torch.randn(shape, generator=generator)).exp()
    truth = Truth(depth, other, 0.8 * depth)
    return Maps(ln_depth, torch.full(shape, -2.0), normal, torch.full(shape, 1.5), ln_depth - 0.3), truth


def test_another_scale_of_a_photo_changes_the_metric_term_alone():
    maps, truth = example()
    factor = torch.tensor([0.7, -0.4])[:, None, None, None]
    scaled = maps._replace(ln_depth=maps.ln_depth + factor, ln_distance=maps.ln_distance + factor)
    before, after = depth_terms(maps, truth), depth_terms(scaled, truth)
    torch.testing.assert_close(after["depth_likelihood"], before["depth_likelihood"])
    torch.testing.assert_close(after["depth_gradient"], before["depth_gradient"])
    torch.testing.assert_close(after["depth_distance"], before["depth_distance"])
    assert after["depth_metric"] > 2 * before["depth_metric"]


def test_pixels_without_truth_have_no_gradient_and_no_part_in_the_value():
    maps, truth = example()
    truth.depth[:, :, :4] = 0.0
    truth.normal[:, :, :4] = 0.0
    truth.distance[:, :, :4] = 0.0
    maps = Maps(*(values.clone().requires_grad_() for values in maps))
    losses(maps, truth)["loss"].backward()
    for values in maps:
        assert (values.grad[:, :, :4] == 0).all()
        assert (values.grad[:, :, 5:] != 0).any()
    with torch.no_grad():
        before = losses(maps, truth)
        maps.ln_depth[:, :, :4] += 3.0
        maps.normal[:, :, :4] *= -1.0
        after = losses(maps, truth)
    assert all(torch.equal(before[name], after[name]) for name in before)


def test_a_batch_without_truth_gives_zero_and_finite_gradients():
    maps, truth = example()
    maps = Maps(*(values.clone().requires_grad_() for values in maps))
    terms = losses(maps, Truth(*(torch.zeros_like(values) for values in truth)))
    terms["loss"].backward()
    assert terms["loss"].item() == 0.0
    assert all(torch.isfinite(values.grad).all() for values in maps)


def test_the_foretold_depth_error_is_best_at_the_mean_error():
    maps, truth = example()
    error = maps.ln_depth - truth.depth.log()
    mean = (error - median_offset(error, truth.depth > 0)).abs().mean()
    ln_scale = torch.full_like(maps.ln_scale, float(mean.log())).requires_grad_()
    depth_terms(maps._replace(ln_scale=ln_scale), truth)["depth_likelihood"].backward()
    assert abs(ln_scale.grad.sum().item()) < 1e-6
    larger = torch.full_like(ln_scale, float(mean.log()) + 0.5).requires_grad_()
    depth_terms(maps._replace(ln_scale=larger), truth)["depth_likelihood"].backward()
    assert float(larger.grad.sum()) > 0.01


def test_training_the_concentration_makes_it_foretell_the_angle():
    maps, truth = example()
    ln_kappa = torch.zeros_like(maps.ln_kappa).requires_grad_()
    optimiser = torch.optim.Adam([ln_kappa], lr=0.05)
    shared = torch.ones_like(ln_kappa)
    for _ in range(200):
        optimiser.zero_grad()
        normal_terms(maps._replace(ln_kappa=ln_kappa.mean() * shared), truth)["normal_likelihood"].backward()
        optimiser.step()
    batch = Batch(torch.zeros(2, 3, 32, 48), torch.eye(3).expand(2, 3, 3), truth)
    scores = [photo_scores(maps._replace(ln_kappa=ln_kappa.detach().mean() * shared), batch, i) for i in (0, 1)]
    found = sum(score["normal_mean"] for score in scores) / 2
    assert sum(score["normal_expected"] for score in scores) / 2 == pytest.approx(found, rel=0.05)


def test_each_photo_has_its_own_median_and_a_blank_one_none():
    error = torch.tensor([[1.0, 2.0, 9.0], [5.0, 7.0, 8.0]])[:, None, None, :]
    valid = torch.tensor([[True, True, True], [False, False, False]])[:, None, None, :]
    assert median_offset(error, valid).flatten().tolist() == [2.0, 0.0]


def test_scores_of_a_perfect_photo_but_for_its_scale():
    _, truth = example()
    maps = Maps(
        truth.depth.log() + math.log(1.5), torch.zeros_like(truth.depth), truth.normal, truth.depth, truth.depth
    )
    scores = photo_scores(maps, Batch(torch.zeros(2, 3, 32, 48), torch.eye(3).expand(2, 3, 3), truth), 1)
    assert scores["abs_rel"] == pytest.approx(0.0, abs=1e-5)
    assert scores["metric_abs_rel"] == pytest.approx(0.5, rel=1e-4)
    assert scores["normal_mean"] == pytest.approx(0.0, abs=0.1)
    assert scores["delta1"] == scores["normal_11"] == 1.0


def test_the_confident_half_is_that_with_the_least_expected_error():
    maps, truth = example()
    wrong = torch.zeros_like(truth.depth)
    wrong[..., 12:] = 0.5 * (-1.0) ** torch.arange(12)
    maps = maps._replace(
        ln_depth=truth.depth.log() + wrong, ln_scale=torch.where(wrong == 0, -3.0, 0.0), normal=truth.normal
    )
    scores = photo_scores(maps, Batch(torch.zeros(2, 3, 32, 48), torch.eye(3).expand(2, 3, 3), truth), 0)
    assert scores["abs_rel_confident"] < 1e-5
    assert scores["abs_rel"] > 0.2
