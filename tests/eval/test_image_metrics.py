"""PSNR and SSIM against their definitions."""

import inspect

import numpy as np
import pytest
from scipy.ndimage import correlate1d

from room2dgs.eval.image_metrics import color_fitted, image_scores, psnr, ssim

RNG = np.random.default_rng(0)
PHOTO = RNG.integers(0, 256, (40, 50, 3), dtype=np.uint8)


def defined_ssim(a, b):
    """Wang et al. 2004: 11 x 11 Gaussian window of sigma 1.5, K1 0.01, K2 0.03, whole windows only."""
    taps = np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))
    taps /= taps.sum()

    def blur(x):
        return correlate1d(correlate1d(x, taps, axis=0), taps, axis=1)[5:-5, 5:-5]

    ma, mb = blur(a), blur(b)
    va, vb, cov = blur(a * a) - ma**2, blur(b * b) - mb**2, blur(a * b) - ma * mb
    c1, c2 = 0.01**2, 0.03**2
    return (((2 * ma * mb + c1) * (2 * cov + c2)) / ((ma**2 + mb**2 + c1) * (va + vb + c2))).mean()


def test_psnr_of_a_known_offset():
    assert psnr(np.full((4, 5, 3), 0.6), np.full((4, 5, 3), 0.5)) == pytest.approx(20)
    assert psnr(PHOTO, PHOTO) == 100


def test_bytes_and_floats_are_one_scale_and_floats_are_clipped():
    assert psnr(PHOTO / 255, PHOTO) == 100
    assert psnr(np.full((4, 4, 3), 1.7), np.full((4, 4, 3), 255, np.uint8)) == 100


def test_ssim_is_the_published_one():
    blurred = np.clip(PHOTO / 255 * 0.7 + 0.1 + RNG.normal(0, 0.05, PHOTO.shape), 0, 1)
    assert ssim(blurred, PHOTO) == pytest.approx(defined_ssim(blurred, PHOTO / 255), abs=1e-9)
    assert ssim(PHOTO, PHOTO) == pytest.approx(1)


def test_means_and_views():
    grey = np.full((20, 20, 3), 0.5)
    result = image_scores([("a", grey + 0.1, grey), ("b", grey + 0.01, grey)])
    assert result["psnr_db"] == pytest.approx(30)
    assert result["views"]["b"]["psnr_db"] == pytest.approx(40)
    assert image_scores([]) == {"psnr_db": None, "psnr_fitted_db": None, "ssim": None, "views": {}}


def test_a_colour_fit_undoes_exposure_and_white_balance_and_nothing_else():
    rendering = 0.2 + 0.5 * RNG.random((30, 40, 3))
    photo = rendering * (1.2, 1.0, 0.8) + (0.0, 0.02, 0.01)
    assert psnr(rendering, photo) < 25
    assert psnr(color_fitted(rendering, photo), photo) > 60
    assert image_scores([("a", rendering, photo)])["psnr_fitted_db"] > 60
    other = RNG.random((30, 40, 3))  # another picture stays another one, but for its mean
    assert psnr(color_fitted(other, photo), photo) < 20
    flat = color_fitted(np.full((30, 40, 3), 0.5), np.full((30, 40, 3), 0.3))
    assert flat == pytest.approx(0.3)


def test_a_colour_fit_looks_neither_at_clipped_nor_at_hidden_pixels():
    rendering = 0.2 + 0.5 * RNG.random((30, 40, 3))
    photo = 1.3 * rendering
    photo[:, :10] = 1.0
    mask = np.ones((30, 40), bool)
    mask[:5] = False
    photo[:5] = 0.5 * RNG.random((5, 40, 3)) + 0.1
    fitted = color_fitted(rendering, photo, mask)
    assert fitted[5:, 10:] == pytest.approx(photo[5:, 10:], abs=2e-3)


def test_a_size_mismatch_is_named():
    with pytest.raises(ValueError, match="view 7"):
        image_scores([("7", np.zeros((4, 4, 3)), np.zeros((4, 5, 3)))])


def test_the_library_gives_functions_not_modules_of_their_name():
    # an attribute of a package is overwritten when a module of that name is imported
    import room2dgs.eval

    for name in room2dgs.eval.__all__:
        assert not inspect.ismodule(getattr(room2dgs.eval, name)), name
        assert not inspect.ismodule(getattr(room2dgs.eval, name)), name
