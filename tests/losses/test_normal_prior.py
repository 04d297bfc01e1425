"""The normal prior's loss against angles that are known."""

import numpy as np
import pytest
import torch

from room2dgs.losses.normal_prior import normal_prior_loss, reweighting

H, W = 6, 7


def constant(*xyz):
    return torch.tensor(xyz, dtype=torch.float64).expand(H, W, 3).clone()


def random_maps(seed=0):
    g = torch.Generator().manual_seed(seed)
    normal = torch.randn(H, W, 3, generator=g, dtype=torch.float64)
    prior = torch.nn.functional.normalize(torch.randn(H, W, 3, generator=g, dtype=torch.float64), dim=-1)
    alpha = 0.3 + 0.7 * torch.rand(H, W, generator=g, dtype=torch.float64)
    return normal, alpha, prior, torch.rand(H, W, generator=g) > 0.2


ONES, ALL = torch.ones(H, W, dtype=torch.float64), torch.ones(H, W, dtype=torch.bool)


@pytest.mark.parametrize("degrees", [0, 5, 60, 90, 180])
@pytest.mark.parametrize("length", [0.5, 0.9, 1.0])
def test_a_known_angle_costs_what_it_should_whatever_the_coverage(degrees, length):
    angle = np.radians(degrees)
    rendered = constant(0, length * np.sin(angle), -length * np.cos(angle))
    prior = constant(0, 0, -1)
    apart = normal_prior_loss(rendered, ONES, prior, ALL, l1=0, cosine=1).item()
    assert apart == pytest.approx(1 - np.cos(angle), abs=1e-5)
    distance = normal_prior_loss(rendered, ONES, prior, ALL, l1=1, cosine=0).item()
    assert distance == pytest.approx(np.sin(angle) + 1 - np.cos(angle), abs=1e-5)
    both = normal_prior_loss(rendered, ONES, prior, ALL).item()
    assert both == pytest.approx(0.01 * apart + 0.01 * distance)


def test_mean_is_over_the_compared_pixels():
    rendered, prior = constant(0, 0, -1), constant(0, 0, -1)
    rendered[0, 0] = torch.tensor([1.0, 0, 0])
    valid = torch.zeros(H, W, dtype=torch.bool)
    valid[0, :4] = True
    assert normal_prior_loss(rendered, ONES, prior, valid, l1=0, cosine=1).item() == pytest.approx(1 / 4, abs=1e-5)


def test_gradcheck():
    normal, alpha, prior, valid = random_maps()
    assert torch.autograd.gradcheck(
        lambda n: normal_prior_loss(n, alpha, prior, valid, l1=0.7, cosine=1.3), normal.requires_grad_()
    )


def weights():
    return torch.rand(H, W, generator=torch.Generator().manual_seed(7), dtype=torch.float64)


def test_gradcheck_with_weights():
    normal, alpha, prior, valid = random_maps()
    assert torch.autograd.gradcheck(
        lambda n: normal_prior_loss(n, alpha, prior, valid, l1=0.7, cosine=1.3, confidence=weights()),
        normal.requires_grad_(),
    )


def test_full_weight_everywhere_changes_no_bit():
    normal, alpha, prior, valid = (part.float() if part.is_floating_point() else part for part in random_maps())
    found = []
    for weight in (None, torch.ones(H, W)):
        leaf = normal.clone().requires_grad_()
        value = normal_prior_loss(leaf, alpha, prior, valid, confidence=weight)
        value.backward()
        found.append((value.item(), leaf.grad.numpy().tobytes()))
    assert found[0] == found[1]


def test_each_pixel_costs_its_weight():
    rendered, prior, weight = constant(1, 0, 0), constant(0, 0, -1), weights()
    value = normal_prior_loss(rendered, ONES, prior, ALL, l1=0, cosine=1, confidence=weight).item()
    assert value == pytest.approx(weight.mean().item(), abs=1e-5)
    weight[2, 3] = torch.nan  # of a pixel that does not count
    valid = ALL.clone()
    valid[2, 3] = False
    assert np.isfinite(normal_prior_loss(rendered, ONES, prior, valid, confidence=weight).item())


@pytest.mark.parametrize("length", [0.3, 1.0])
def test_reweighting_quarters_the_weight_at_its_width_and_spares_what_agrees(length):
    prior = constant(0, 0, -1)

    def at(degrees, width_deg):
        angle = np.radians(degrees)
        rendered = constant(0, length * np.sin(angle), -length * np.cos(angle)).requires_grad_()
        found = reweighting(rendered, prior, width_deg)
        assert not found.requires_grad and found.shape == (H, W)
        return found[0, 0].item()

    for width_deg in (10, 30, 60):
        assert at(0, width_deg) == pytest.approx(1, abs=1e-2)
        assert at(width_deg, width_deg) == pytest.approx(0.25, abs=1e-2)
        assert at(180, width_deg) < 0.05
        falling = [at(degrees, width_deg) for degrees in range(0, 181, 15)]
        assert falling == sorted(falling, reverse=True)
    assert at(20, 10) < at(20, 30)
    assert (reweighting(constant(0, 0, 0), prior, 20) < 0.2).all()


def test_pixels_that_do_not_count_have_no_say_and_no_gradient():
    normal, alpha, prior, valid = random_maps()
    counts = valid & (alpha >= 0.5)
    values = []
    for garbage in (0.0, torch.nan):
        leaf = torch.where(counts[..., None], normal, garbage).requires_grad_()
        value = normal_prior_loss(leaf, alpha, torch.where(counts[..., None], prior, garbage), valid)
        value.backward()
        assert (leaf.grad[~counts] == 0).all() and (leaf.grad[counts] != 0).any()
        values.append(value.item())
    assert values[0] == values[1] > 0


def test_a_normal_of_no_length_has_a_finite_gradient():
    leaf = constant(0, 0, 0).float().requires_grad_()
    normal_prior_loss(leaf, ONES.float(), constant(0, 0, -1).float(), ALL).backward()
    assert torch.isfinite(leaf.grad).all() and leaf.grad.abs().max() < 1e3


def test_no_pixel_costs_nothing():
    normal, alpha, prior, valid = random_maps()
    value = normal_prior_loss(normal.requires_grad_(), alpha, prior, ~ALL & valid)
    value.backward()
    assert value.item() == 0 and (normal.grad == 0).all()


def test_the_gradient_turns_the_normal_towards_the_prior():
    normal, prior = constant(0.3, 0.2, -0.8).requires_grad_(), constant(0, 0, -1)
    loss = normal_prior_loss(normal, ONES, prior, ALL)
    loss.backward()
    step = (normal - normal.grad).detach()
    assert normal_prior_loss(step, ONES, prior, ALL) < loss


def test_other_sizes_are_refused():
    normal, alpha, prior, valid = random_maps()
    with pytest.raises(ValueError, match="differ in size"):
        normal_prior_loss(normal, alpha[1:], prior, valid)
    with pytest.raises(ValueError, match="differ in size"):
        normal_prior_loss(normal, alpha, prior, valid, confidence=weights()[1:])
