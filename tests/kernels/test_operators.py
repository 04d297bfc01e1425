"""torch's dispatcher chooses the kernels; block code can take the CPU's place, and gives it back."""

from __future__ import annotations

import pytest
import torch

from room2dgs import losses, splat
from room2dgs.kernels.builds import BLOCK_BUILDS, CPU, PLAIN, build_of, is_asynchronous
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.kernels.operators import BY_BLOCK_CODE, has_kernels

DRAWN = torch.Generator().manual_seed(0)
RENDERED, TARGET = (torch.rand(20, 30, 3, generator=DRAWN) for _ in range(2))


@pytest.fixture
def calls(monkeypatch):
    """Names of the operators that block code was asked for."""
    found = []
    for name, kernels in list(BY_BLOCK_CODE.items()):
        monkeypatch.setitem(
            BY_BLOCK_CODE, name, lambda *x, name=name, kernels=kernels: (found.append(name), kernels(*x))[1]
        )
    return found


def test_every_operator_has_kernels_for_the_cpu_and_none_of_its_own_gradients():
    assert {*BY_BLOCK_CODE} == {
        "rasterize", "rasterize_backward", "rasterize_gaussians", "rasterize_gaussians_backward",
        "rgb_loss", "normal_consistency", "depth_prior", "normal_prior", "multiview",
    }  # fmt: skip
    for name in BY_BLOCK_CODE:
        assert torch._C._dispatch_has_kernel_for_dispatch_key(f"room2dgs::{name}", "CPU"), name
    value, gradient = torch.ops.room2dgs.rgb_loss(RENDERED.clone().requires_grad_(), TARGET, 0.2, True)
    assert not value.requires_grad and not gradient.requires_grad and gradient.shape == RENDERED.shape


def test_tensors_of_a_device_without_kernels_are_refused_by_the_dispatcher():
    with pytest.raises(NotImplementedError, match=r"room2dgs::rgb_loss.*Meta"):
        torch.ops.room2dgs.rgb_loss(RENDERED.to("meta"), TARGET.to("meta"), 0.2, True)


def test_block_code_takes_the_cpus_place_and_gives_it_back_after_an_error(calls):
    def loss():
        return losses.rgb_loss(RENDERED, TARGET, 0.2)

    before = loss()
    assert calls == [] and build_of("cpu") is CPU and not is_asynchronous(before)
    with pytest.raises(KeyError), cuda_kernels_on_cpu():
        by_blocks = loss()
        assert calls == ["rgb_loss"] and build_of("cpu") is PLAIN and is_asynchronous(by_blocks)
        raise KeyError
    assert torch.equal(loss(), before) and calls == ["rgb_loss"]
    assert build_of("cpu") is CPU and "cpu" not in BLOCK_BUILDS
    torch.testing.assert_close(by_blocks, before)


def test_one_emulation_within_another_ends_alone(calls):
    with cuda_kernels_on_cpu():
        with cuda_kernels_on_cpu():
            losses.rgb_loss(RENDERED, TARGET, 0.2)
        losses.rgb_loss(RENDERED, TARGET, 0.2)
        assert calls == ["rgb_loss"] * 2 and build_of("cpu") is PLAIN
    losses.rgb_loss(RENDERED, TARGET, 0.2)
    assert calls == ["rgb_loss"] * 2


def test_kernels_are_for_float32_of_one_device():
    assert has_kernels(RENDERED, TARGET)
    assert not has_kernels(RENDERED.double(), TARGET.double()) and not has_kernels(RENDERED, TARGET.double())
    assert not has_kernels(RENDERED.to("meta")) and not has_kernels(RENDERED, TARGET.to("meta"))


def test_forward_and_backward_pass_go_to_the_same_kernels(calls):
    def surfels():
        g = torch.Generator().manual_seed(1)
        centers = 0.3 * torch.randn(30, 3, generator=g) + torch.tensor([0, 0, 2.0])
        parts = (torch.randn(30, 4, generator=g), 0.05 + 0.1 * torch.rand(30, 2, generator=g))
        return splat.Surfels(
            centers.requires_grad_(), *parts, torch.rand(30, generator=g), torch.randn(30, 1, 3, generator=g)
        )

    K = torch.tensor([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]])
    gradients = []
    for emulated in (False, True):
        drawn = surfels()
        if emulated:
            with cuda_kernels_on_cpu():
                splat.render(drawn, K, torch.eye(4), 32, 24).color.sum().backward()
        else:
            splat.render(drawn, K, torch.eye(4), 32, 24).color.sum().backward()
        gradients.append(drawn.centers.grad)
    assert calls == ["rasterize", "rasterize_backward"]
    assert gradients[0].abs().max() > 0
    torch.testing.assert_close(gradients[1], gradients[0], rtol=1e-3, atol=1e-4)
