"""The compiled losses of both priors against torch's in float64, at all steps and sizes, with holes and no numbers."""

import pytest
import torch

from room2dgs.losses.depth_prior import depth_prior_loss
from room2dgs.losses.normal_prior import normal_prior_loss

SIZES = [(1, 1), (7, 9), (16, 24), (33, 50), (61, 43)]


def maps(height, width, step, seed=0):
    """Depth, alpha, normal of a rendering; prior depth and normal, valid, confidence of every step-th pixel."""
    g = torch.Generator().manual_seed(seed)
    draw = lambda *shape: torch.rand(*shape, generator=g, dtype=torch.float64)  # noqa: E731
    depth, normal = 1 + 3 * draw(height, width), 2 * draw(height, width, 3) - 1
    tall, wide = depth[::step, ::step].shape
    prior = depth[::step, ::step] * (0.9 + 0.2 * draw(tall, wide))
    prior_normal = torch.nn.functional.normalize(2 * draw(tall, wide, 3) - 1, dim=-1)
    for values, holes in ((depth, (0.0, -1.0)), (prior, (0.0, torch.nan, torch.inf))):
        for value in holes:
            values[torch.rand(values.shape, generator=g) < 0.03] = value
    valid = draw(tall, wide) > 0.2
    normal[::step, ::step][~valid] = torch.nan
    prior_normal[~valid] = torch.nan
    return depth, 0.3 + 0.7 * draw(height, width), normal, prior, prior_normal, valid, draw(tall, wide)


def differentiated(loss, at, *others, dtype, **options):
    to = lambda x: x.to(dtype) if torch.is_tensor(x) and x.is_floating_point() else x  # noqa: E731
    leaf = to(at).clone().requires_grad_()
    options = {name: to(value) for name, value in options.items()}
    value = loss(leaf, *map(to, others), **options)
    (gradient,) = torch.autograd.grad(3 * value, leaf)
    return value.detach().double(), gradient.double()


def same(loss, *values, **options):
    found, wanted = (differentiated(loss, *values, dtype=dtype, **options) for dtype in (torch.float32, torch.float64))
    for a, b in zip(found, wanted, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5 * float(b.abs().max()))
    return found


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("weighted", [True, False])
def test_normals(size, step, weighted):
    _, alpha, normal, _, prior, valid, confidence = maps(*size, step)
    confidence = confidence if weighted else None
    value, gradient = same(normal_prior_loss, normal, alpha, prior, valid, confidence=confidence, step=step, l1=0.7)
    assert value > 0 or not valid.any()
    compared = torch.zeros(size, dtype=torch.bool)
    compared[::step, ::step] = valid & (alpha[::step, ::step] >= 0.5)
    assert torch.equal(gradient.any(-1), compared)


@pytest.mark.parametrize("size", [*SIZES, (90, 120)], ids=str)
@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize(
    "options",
    [{}, {"align": True}, {"space": "disparity"}, {"gradient_weight": 0.0}, {"scales": 2}, {"confidence": None}],
    ids=str,
)
def test_depth(size, step, options):
    depth, alpha, _, prior, _, valid, confidence = maps(*size, step)
    if options.get("space") == "disparity":
        prior = 1 / prior
    options = {"align": False, "confidence": confidence, "step": step, **options}
    value, gradient = same(depth_prior_loss, depth, alpha, prior, valid, **options)
    there = valid & prior.isfinite() & (prior > 0) & (alpha[::step, ::step] >= 0.5) & (depth[::step, ::step] > 0)
    assert (value > 0) == gradient.any() == (there.sum() >= 64)
    between = torch.ones(size, dtype=torch.bool)
    between[::step, ::step] = False
    assert not gradient[between].any()


@pytest.mark.parametrize("loss", [normal_prior_loss, depth_prior_loss])
def test_maps_of_another_step_are_refused(loss):
    depth, alpha, normal, prior, prior_normal, valid, _ = maps(20, 30, 2)
    of = (normal, alpha, prior_normal, valid) if loss is normal_prior_loss else (depth, alpha, prior, valid)
    with pytest.raises(ValueError, match="differ in size"):
        loss(*of, step=3)


def test_the_gradient_comes_once():
    depth, alpha, _, prior, _, valid, _ = (x.float() if x.is_floating_point() else x for x in maps(20, 30, 1))
    leaf = depth.requires_grad_()
    loss = depth_prior_loss(leaf, alpha, prior, valid)
    loss.backward(retain_graph=True)
    with pytest.raises(RuntimeError):
        loss.backward()
