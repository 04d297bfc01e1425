"""The fused photometric loss against the float64 reference."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C
from room2dgs.geometry.similarity import ssim
from room2dgs.losses import reference
from room2dgs.losses.photometric import rgb_loss


@pytest.fixture(autouse=True)
def threads():
    before = _C.threads()
    yield
    _C.set_threads(before)


def images(height, width, seed=0, noise=0.05):
    """A blocky photo with noise and a rendering that is near it."""
    generator = torch.Generator().manual_seed(seed)
    coarse = torch.rand(height // 4 + 1, width // 4 + 1, 3, generator=generator)
    target = coarse.repeat_interleave(4, 0).repeat_interleave(4, 1)[:height, :width].contiguous()
    rendered = target + noise * torch.randn(height, width, 3, generator=generator)
    return rendered.clamp(0, 1), target


def value_and_gradient(loss, rendered, target, dssim):
    rendered = rendered.clone().requires_grad_()
    value = loss(rendered, target, dssim)
    value.backward()
    return value.item(), rendered.grad


def check_against_reference(rendered, target, dssim):
    value, gradient = value_and_gradient(rgb_loss, rendered, target, dssim)
    wanted, wanted_gradient = value_and_gradient(reference.rgb_loss, rendered.double(), target.double(), dssim)
    # SSIM is of the order of 1, so the loss of a single pixel has float32's digits of 1, not of itself
    digits = 1e-5 * wanted + dssim * 4e-6 / rendered.shape[0] / rendered.shape[1]
    assert abs(value - wanted) <= digits
    assert (gradient - wanted_gradient).abs().max() <= 1e-4 * wanted_gradient.abs().max()


# sizes about the vector's 8 floats (3 a pixel), the window's 11 rows and the strips of 16 rows
@pytest.mark.parametrize(
    "size", [(1, 1), (1, 9), (7, 1), (5, 5), (11, 8), (13, 3), (16, 11), (17, 16), (33, 21), (61, 83)]
)
@pytest.mark.parametrize("dssim", [0.2, 1.0])
def test_equals_the_reference_at_every_size(size, dssim):
    check_against_reference(*images(*size), dssim)


@settings(max_examples=30, deadline=None)
@given(
    height=st.integers(1, 40),
    width=st.integers(1, 40),
    seed=st.integers(0, 1000),
    noise=st.sampled_from([1e-3, 0.05, 1.0]),
)
def test_equals_the_reference_on_random_images(height, width, seed, noise):
    check_against_reference(*images(height, width, seed, noise), 0.2)


@pytest.mark.parametrize("low, high", [(0.0, 1.0), (1.0, 0.0), (0.0, 0.01), (1.0, 0.99)])
def test_flat_black_and_white_images(low, high):
    # flat images leave only C2 in the denominator: the variances' rounding is all that can go wrong
    rendered = torch.full((24, 37, 3), low)
    rendered[10:, 20:] = high
    check_against_reference(rendered, torch.full((24, 37, 3), high), 0.2)


@pytest.mark.parametrize("colour", [0.0, 0.3, 1.0])
def test_equal_images_have_no_loss_and_no_gradient(colour):
    flat = torch.full((19, 23, 3), colour)
    assert value_and_gradient(rgb_loss, flat, flat, 0.2) == (0.0, pytest.approx(np.zeros((19, 23, 3)), abs=0))
    photo = images(19, 23)[1]
    value, gradient = value_and_gradient(rgb_loss, photo, photo, 1.0)
    assert value == 0.0
    assert (gradient == 0.0).all()


def test_ssim_of_a_known_pair():
    # Constants p and q far from the border: only the luminance factor (2pq + C1)/(p^2 + q^2 + C1) is left.
    rendered, target = torch.full((11, 11, 3), 0.2), torch.full((11, 11, 3), 0.6)
    centre = ssim(rendered.double(), target.double(), "zeros")[5, 5]
    assert centre.tolist() == pytest.approx([(2 * 0.12 + 1e-4) / (0.04 + 0.36 + 1e-4)] * 3, rel=1e-6)
    # One pixel: the window's centre weight w scales the means, and the variance is (w - w^2) p^2.
    offsets = np.exp(-(np.arange(-5, 6) ** 2) / 4.5)
    w = (1.0 / offsets.sum()) ** 2
    p, q = 0.2, 0.6
    covariance, variances = (w - w * w) * p * q, (w - w * w) * (p * p + q * q)
    luminance = (2 * w * w * p * q + 1e-4) / (w * w * (p * p + q * q) + 1e-4)
    structure = (2 * covariance + 9e-4) / (variances + 9e-4)
    value = rgb_loss(rendered[:1, :1], target[:1, :1], 1.0).item()
    assert value == pytest.approx(1 - luminance * structure, rel=1e-5)


def test_the_gradient_reaches_ten_pixels_and_no_further():
    rendered, target = images(40, 50)
    first = value_and_gradient(rgb_loss, rendered, target, 1.0)[1]
    rendered[20, 25] = 1 - rendered[20, 25]
    moved = (value_and_gradient(rgb_loss, rendered, target, 1.0)[1] != first).any(-1).nonzero()
    assert moved.min(0).values.tolist() == [10, 15]
    assert moved.max(0).values.tolist() == [30, 35]


def test_same_bits_on_any_number_of_threads():
    # tall enough for the strips to be cut differently
    rendered, target = images(301, 29)
    results = []
    for count in (1, 2, 3):
        _C.set_threads(count)
        results.append(value_and_gradient(rgb_loss, rendered, target, 0.2))
    for value, gradient in results[1:]:
        assert value == results[0][0]
        assert torch.equal(gradient, results[0][1])


def test_value_is_the_same_without_a_gradient():
    rendered, target = images(45, 38)
    assert rgb_loss(rendered, target, 0.2).item() == value_and_gradient(rgb_loss, rendered, target, 0.2)[0]


def test_gradient_is_scaled_by_what_follows():
    rendered, target = images(20, 20)
    plain = value_and_gradient(rgb_loss, rendered, target, 0.2)[1]
    scaled = value_and_gradient(lambda *a: 3.0 * rgb_loss(*a), rendered, target, 0.2)[1]
    torch.testing.assert_close(scaled, 3.0 * plain, rtol=1e-6, atol=0)


def test_a_second_backward_is_refused_rather_than_wrong():
    rendered, target = images(8, 8)
    loss = rgb_loss(rendered.requires_grad_(), target, 0.2)
    loss.backward(retain_graph=True)
    with pytest.raises(RuntimeError):
        loss.backward()


def test_transposed_images_are_taken_by_value_not_by_memory():
    rendered, target = images(21, 34)
    across = rgb_loss(rendered.transpose(0, 1), target.transpose(0, 1), 0.2).item()
    assert across == pytest.approx(rgb_loss(rendered, target, 0.2).item(), rel=1e-6)


def test_nan_shows_in_the_loss():
    rendered, target = images(30, 30)
    rendered[3, 4, 1] = float("nan")
    value, gradient = value_and_gradient(rgb_loss, rendered, target, 0.2)
    assert np.isnan(value)
    assert torch.isfinite(gradient[20:]).all()


def test_l1_alone():
    rendered, target = images(9, 9)
    assert rgb_loss(rendered, target, 0.0).item() == pytest.approx((rendered - target).abs().mean().item())


def test_sizes_that_differ_are_refused():
    with pytest.raises(ValueError, match="differ in size"):
        rgb_loss(torch.zeros(4, 5, 3), torch.zeros(5, 4, 3), 0.2)


def test_reference_gradcheck():
    rendered, target = (image.double() for image in images(6, 7))
    torch.autograd.gradcheck(lambda x: reference.rgb_loss(x, target, 0.5), rendered.requires_grad_())


SIZES_IN_FOREIGN_MEMORY = """
import numpy as np
from room2dgs import _C
random = np.random.default_rng(0)
for width in range(1, 34):
    x, y = random.random((2, 13, width, 3), dtype=np.float32)
    gradient = np.empty_like(x)
    value = _C.rgb_loss(x, y, 0.2, gradient)
    print(width, *value, gradient.sum(dtype=float), abs(gradient).max())
"""


@pytest.mark.parametrize("isa", ["baseline", "avx2", "avx512"])
def test_values_hang_on_nothing_that_memory_held_before(isa):
    """Rows end anywhere in a vector, and a wider vector's row is longer: what lies between belongs to nobody."""
    found = []
    for byte in ("0", "128", "1"):  # glibc fills what it gives out with its complement; 0: leaves it as it is
        environment = {**os.environ, "MALLOC_PERTURB_": byte, "ROOM2DGS_ISA": isa}
        code = [sys.executable, "-c", SIZES_IN_FOREIGN_MEMORY]  # without torch, which takes seconds to import
        found.append(subprocess.run(code, env=environment, capture_output=True, text=True, check=True).stdout)
    assert "nan" not in found[0] and found[1] == found[0] and found[2] == found[0]
