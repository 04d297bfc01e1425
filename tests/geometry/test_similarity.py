"""SSIM against its definition, at both borders."""

import numpy as np
import pytest
import torch
from scipy.ndimage import correlate1d

from room2dgs.geometry.similarity import ssim


def defined(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Wang et al. 2004: 11 x 11 Gaussian window of sigma 1.5, K1 0.01, K2 0.03, zeros outside."""
    taps = np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))
    taps /= taps.sum()

    def blur(x):
        return correlate1d(correlate1d(x, taps, axis=0, mode="constant"), taps, axis=1, mode="constant")

    ma, mb = blur(a), blur(b)
    va, vb, cov = blur(a * a) - ma**2, blur(b * b) - mb**2, blur(a * b) - ma * mb
    return ((2 * ma * mb + 1e-4) * (2 * cov + 9e-4)) / ((ma**2 + mb**2 + 1e-4) * (va + vb + 9e-4))


@pytest.mark.parametrize("size", [(13, 29), (40, 31)])
def test_equals_the_definition(size):
    a, b = np.random.default_rng(0).random((2, *size, 3))
    first, second = torch.from_numpy(a), torch.from_numpy(b)
    np.testing.assert_allclose(ssim(first, second, "zeros"), defined(a, b), atol=1e-10)
    np.testing.assert_allclose(ssim(first, second, "inside"), defined(a, b)[5:-5, 5:-5], atol=1e-10)


def test_images_smaller_than_the_window_are_black_outside():
    a, b = np.random.default_rng(1).random((2, 2, 1, 3))
    np.testing.assert_allclose(ssim(torch.from_numpy(a), torch.from_numpy(b), "zeros"), defined(a, b), atol=1e-10)
