"""The losses' kernels for CUDA, as plain C++: the float64 reference, the CPU's kernels, any order of blocks."""

from __future__ import annotations

from contextlib import nullcontext

import pytest
import torch

from room2dgs import _C
from room2dgs.geometry.depth_maps import depth_to_normals
from room2dgs.kernels.builds import BLOCK_BUILDS, PLAIN, set_order
from room2dgs.kernels.calls import call
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.kernels.operators import BY_BLOCK_CODE
from room2dgs.losses import reference
from room2dgs.losses.depth_prior import depth_prior_loss
from room2dgs.losses.normal_prior import normal_prior_loss
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import normal_consistency
from room2dgs.splat.types import Rendering

SIZES = [(1, 1), (1, 17), (5, 5), (16, 16), (17, 31), (33, 8), (61, 83)]  # about the patches' 16 and the window's 11
ORDERS = (0, 1, 12345)


@pytest.fixture(autouse=True)
def in_order():
    yield
    set_order(0)


def same_in_any_order(compute, found):
    """Another order of blocks and threads gives the same bits."""
    for order in ORDERS[1:]:
        set_order(order)
        assert all(torch.equal(a, b) for a, b in zip(compute(), found, strict=True))


def by_blocks(loss):
    """A loss by block code."""

    def found(*args, **more):
        with cuda_kernels_on_cpu():
            return loss(*args, **more)

    return found


rgb_by_blocks = by_blocks(rgb_loss)


def images(height, width, seed=0, noise=0.05):
    g = torch.Generator().manual_seed(seed)
    coarse = torch.rand(height // 4 + 1, width // 4 + 1, 3, generator=g)
    target = coarse.repeat_interleave(4, 0).repeat_interleave(4, 1)[:height, :width].contiguous()
    return (target + noise * torch.randn(height, width, 3, generator=g)).clamp(0, 1), target


def maps(height, width, seed=0):
    """Depth with holes and what is no number, alpha, normals."""
    g = torch.Generator().manual_seed(seed)
    depth = 2 + torch.rand(height, width, generator=g)
    for value in (0.0, -1.0, torch.nan, torch.inf):
        depth[torch.rand(height, width, generator=g) < 0.02] = value
    return depth, torch.rand(height, width, generator=g), torch.randn(height, width, 3, generator=g)


def differentiated(loss, *inputs):
    leaves = [x.clone().requires_grad_() for x in inputs]
    value = loss(*leaves)
    return [value.detach(), *torch.autograd.grad(value, leaves)]


def assert_near(actual, expected, relative):
    for a, b in zip(actual, expected, strict=True):
        assert a.shape == b.shape and (a.double() - b.double()).abs().max() <= relative * b.abs().max()


def of_rgb(loss, rendered, target):
    return differentiated(lambda x: loss(x, target, 0.2), rendered)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("noise", [1e-3, 1.0])
def test_rgb_loss(size, noise):
    rendered, target = images(*size, seed=size[0], noise=noise)
    found = of_rgb(rgb_by_blocks, rendered, target)
    value, gradient = of_rgb(reference.rgb_loss, rendered.double(), target.double())
    # SSIM is of the order of 1, so the loss of a single pixel has float32's digits of 1, not of itself
    assert abs(found[0] - value) <= 1e-5 * value + 0.2 * 4e-6 / size[0] / size[1]
    assert_near(found[1:], [gradient], 1e-4)
    # the CPU's kernels take the same steps; only their fused multiply-adds differ
    assert_near(found[1:], of_rgb(rgb_loss, rendered, target)[1:], 3e-5)
    same_in_any_order(lambda: of_rgb(rgb_by_blocks, rendered, target), found)


def test_rgb_loss_without_a_gradient_has_the_same_value():
    rendered, target = images(37, 21)
    assert rgb_by_blocks(rendered, target, 0.2) == of_rgb(rgb_by_blocks, rendered, target)[0]
    assert rgb_by_blocks(target, target, 1.0) == 0


def of_normals(loss, depth, alpha, normal, pose):
    return differentiated(lambda d, n, p: loss(d, alpha, n, p), depth, normal, pose)


@pytest.mark.parametrize("size", SIZES)
def test_normal_consistency(camera, size):
    pose = torch.from_numpy(camera.cam_from_world)
    depth, alpha, normal = maps(*size, seed=size[1])

    def by_cpu(d, a, n, p):
        drawn = Rendering(torch.zeros_like(n), a, d, d, n, torch.zeros_like(d))
        return normal_consistency(drawn, torch.from_numpy(camera.K), p)

    on_blocks = by_blocks(by_cpu)
    found = of_normals(on_blocks, depth, alpha, normal, pose)
    clean = torch.where((depth > 0) & depth.isfinite(), depth, torch.zeros_like(depth))
    doubles = (clean.double(), alpha.double(), normal.double(), pose)
    assert_near(
        found, of_normals(lambda d, a, n, p: reference.normal_consistency(d, a, n, camera.K, p), *doubles), 1e-4
    )
    if min(size) > 2:
        assert all(x.abs().max() > 0 for x in found)

    assert_near(found, of_normals(by_cpu, depth, alpha, normal, pose), 3e-5)
    same_in_any_order(lambda: of_normals(on_blocks, depth, alpha, normal, pose), found)


@pytest.mark.parametrize("size", SIZES)
def test_depth_normals(camera, size):
    pose = torch.from_numpy(camera.cam_from_world)
    depth = maps(*size)[0]
    clean = torch.where((depth > 0) & depth.isfinite(), depth, torch.zeros_like(depth))
    exact = depth_to_normals(clean.double(), torch.from_numpy(camera.K), pose)
    for order in ORDERS:
        set_order(order)
        found = torch.empty(*size, 3)
        cameras = (torch.from_numpy(camera.K).float(), pose.float())
        call(_C.device.BlockLosses().depth_normals, depth, *cameras, found, order)
        assert (found - exact).abs().max() < 1e-5 and torch.equal(found == 0, exact.float() == 0)


def test_the_bits_do_not_depend_on_threads():
    rendered, target = images(50, 70)
    before = _C.threads()
    try:
        found = []
        for count in (1, 3):
            _C.set_threads(count)
            found.append(of_rgb(rgb_by_blocks, rendered, target))
    finally:
        _C.set_threads(before)
    assert all(torch.equal(a, b) for a, b in zip(*found, strict=True))


def test_arguments_are_checked():
    losses, image = _C.device.BlockLosses(), torch.rand(4, 5, 3)
    values = torch.empty(2, dtype=torch.float64)
    for wrong, kind in (
        ((image, image[:3], 0.2, values, None), ValueError),
        ((image, image, 2.0, values, None), ValueError),
        ((image.double(), image, 0.2, values, None), TypeError),
        ((image, image, 0.2, values, image), ValueError),  # the gradient over its own input
        ((image[:0], image[:0], 0.2, values, None), ValueError),
    ):
        with pytest.raises(kind):
            losses.rgb_loss(*wrong)


def priors(height, width, seed=0):
    """Rendered depth, alpha, a prior that resembles it, where it counts, confidence; holes and what is no number."""
    g = torch.Generator().manual_seed(seed)
    depth = 1 + 3 * torch.rand(height, width, generator=g)
    prior = 0.4 * depth + 0.3 + 0.2 * torch.rand(height, width, generator=g)
    for values, holes in ((depth, (0.0, -1.0)), (prior, (0.0, -1.0, torch.nan, torch.inf))):
        for value in holes:
            values[torch.rand(height, width, generator=g) < 0.02] = value
    alpha, confidence = (torch.rand(height, width, generator=g) for _ in range(2))
    return depth, 0.3 + alpha, prior, torch.rand(height, width, generator=g) > 0.1, confidence


def of_depth(depth, alpha, prior, valid, confidence, with_blocks, **options):
    def loss(d):
        with cuda_kernels_on_cpu() if with_blocks else nullcontext():
            return depth_prior_loss(d, alpha, prior, valid, confidence=confidence, **options)

    return differentiated(loss, depth)


@pytest.mark.parametrize("size", [*SIZES, (64, 5), (128, 96)])
@pytest.mark.parametrize(
    "options",
    [{}, {"align": False}, {"space": "disparity"}, {"gradient_weight": 0.0}, {"scales": 2}, {"weighted": False}],
    ids=str,
)
def test_depth_prior(size, options):
    """Alignment, mean and gradient term, and both ends: too few pixels, and neighbours at all strides."""
    options = dict(options)
    *maps, confidence = priors(*size, seed=size[0])
    confidence = confidence if options.pop("weighted", True) else None
    found = of_depth(*maps, confidence, True, **options)
    doubles = [x.double() if x is not None and x.is_floating_point() else x for x in (*maps, confidence)]
    assert_near(found, of_depth(*doubles, False, **options), 1e-4)
    assert_near(found, of_depth(*maps, confidence, False, **options), 1e-4)
    assert (found[0] == 0) == (size[0] * size[1] < 100)
    same_in_any_order(lambda: of_depth(*maps, confidence, True, **options), found)


def test_depth_prior_of_maps_that_fix_no_scale():
    """Flat ones, and those that are upside down or unrelated: the ratio of the means, as the CPU has it."""
    g = torch.Generator().manual_seed(0)
    ramp = (2 + 0.1 * torch.arange(30.0)).expand(20, 30).contiguous()
    noise = 1 + torch.rand(20, 30, generator=g)
    one, here = torch.ones(20, 30), torch.ones(20, 30, dtype=torch.bool)
    for depth, prior in ((noise, 3 * one), (3 * one, noise), (ramp, 6 - ramp), (ramp, noise)):
        found = of_depth(depth, one, prior, here, None, True)
        assert_near(found, of_depth(depth.double(), one.double(), prior.double(), here, None, False), 1e-4)
    exact = of_depth(ramp, one, 7 * ramp, here, None, True)
    assert exact[0] < 1e-10 and exact[1].abs().max() < 1e-6  # a rounding has no sign


def test_where_block_code_is_at_work_it_takes_all_fused_losses(monkeypatch, camera):
    """And nothing else does: neither other types nor the CPU by itself."""
    taken = []
    for name in ("rgb_loss", "normal_consistency", "depth_prior", "normal_prior"):
        kernels = BY_BLOCK_CODE[name]
        monkeypatch.setitem(
            BY_BLOCK_CODE, name, lambda *x, name=name, kernels=kernels: (taken.append((name, x)), kernels(*x))[1]
        )
    rendered, target = images(4, 5)
    depth, alpha, normal = maps(4, 5)
    drawn = Rendering(torch.zeros(4, 5, 3), alpha, depth, depth + 1, normal, depth)

    def ask(dssim=0.2):
        rgb_loss(rendered, target, dssim)
        normal_consistency(drawn, camera.K, camera.cam_from_world, "median")
        depth_prior_loss(depth, alpha, depth, depth > 0)
        normal_prior_loss(normal, alpha, normal, depth > 0)

    ask()
    assert taken == []
    with cuda_kernels_on_cpu():
        ask()
        rgb_loss(rendered, target, 0.0)  # L1 alone is torch's
        rgb_loss(rendered.double(), target.double(), 0.2)
    assert [name for name, _ in taken] == ["rgb_loss", "normal_consistency", "depth_prior", "normal_prior"]
    assert torch.equal(taken[1][1][1].nan_to_num(), drawn.median_depth.nan_to_num()) and taken[0][1][0] is PLAIN
    assert "cpu" not in BLOCK_BUILDS and PLAIN.extension is _C.device
    ask()  # the CPU's kernels again
    assert len(taken) == 4


def normals(height, width, step, seed=0):
    """Rendered normals of any length and alpha; of every step-th pixel a prior, where it counts, its confidence."""
    g = torch.Generator().manual_seed(seed)
    rendered, alpha = torch.randn(height, width, 3, generator=g), torch.rand(height, width, generator=g)
    tall, wide = alpha[::step, ::step].shape
    rendered[torch.rand(height, width, generator=g) < 0.05] = 0
    prior = torch.nn.functional.normalize(torch.randn(tall, wide, 3, generator=g), dim=-1)
    valid = torch.rand(tall, wide, generator=g) > 0.2
    prior[~valid] = torch.nan
    rendered[::step, ::step][~valid] = torch.nan
    return rendered, 0.3 + alpha, prior, valid, torch.rand(tall, wide, generator=g)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("weighted", [True, False])
def test_normal_prior(size, step, weighted):
    rendered, *others, confidence = normals(*size, step, seed=size[0])

    def of(dtype, code):
        to = [x.to(dtype) if x.is_floating_point() else x for x in (rendered, *others, confidence)]
        options = {"confidence": to[4] if weighted else None, "step": step, "l1": 0.7, "cosine": 0.2}
        with code():
            return differentiated(lambda n: 3 * normal_prior_loss(n, *to[1:4], **options), to[0])

    found = of(torch.float32, cuda_kernels_on_cpu)
    alpha, _, valid = others
    assert found[1].any() == (valid & (alpha[::step, ::step] >= 0.5)).any()
    assert_near(found, of(torch.float64, nullcontext), 1e-4)
    assert_near(found, of(torch.float32, nullcontext), 3e-5)
    same_in_any_order(lambda: of(torch.float32, cuda_kernels_on_cpu), found)
