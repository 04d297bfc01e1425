"""Pixels keep their places on the way into a network and back, and values their meaning."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.config.card import Card, CardDepth, CardInput
from room2dgs.depth.network.card import NetworkFormat, card_format
from room2dgs.depth.network.fit import FILL, fitted, input_intrinsics, network_input, photo_part
from room2dgs.geometry.camera import Camera

CAMERA = Camera(np.array([[60.0, 0, 41.0], [0, 61.0, 29.0], [0, 0, 1.0]]), 80, 60, np.eye(4))


def network_format(**changes) -> NetworkFormat:
    return card_format(Card(card=1, input=CardInput(**changes), depth=CardDepth(meaning="metric_depth")), "depth")


@settings(max_examples=60, deadline=None)
@given(
    st.integers(8, 90), st.integers(8, 90), st.sampled_from(["stretch", "pad", "cover"]), st.sampled_from([1, 4, 14])
)
def test_the_photo_keeps_its_place(height, width, how, multiple):
    fit = fitted(CAMERA, height, width, how, multiple)
    if how == "cover":
        assert fit.height % multiple == fit.width % multiple == 0
        assert fit.height >= height - multiple / 2 and fit.width >= width - multiple / 2
        assert abs(fit.width / fit.height / (80 / 60) - 1) <= multiple * (1 / fit.height + 1 / fit.width)
    else:
        assert (fit.height, fit.width) == (height, width)
        assert 0 <= fit.top <= fit.height - fit.inner_height and 0 <= fit.left <= fit.width - fit.inner_width
        assert how == "stretch" or fit.inner_height == height or fit.inner_width == width
    # a pixel's ray meets the same part of the photo
    K = input_intrinsics(CAMERA, fit)
    x, y = (K @ np.linalg.inv(CAMERA.K) @ [20.0, 45.0, 1.0])[:2]
    assert (x - fit.left) / fit.inner_width == pytest.approx(20 / 80)
    assert (y - fit.top) / fit.inner_height == pytest.approx(45 / 60)


@pytest.mark.parametrize("scale", [1, 0.5, 2])
def test_the_photos_part_comes_back_without_the_padding(scale):
    fit = fitted(CAMERA, 60, 120, "pad")
    assert (fit.left, fit.inner_width, fit.top, fit.inner_height) == (20, 80, 0, 60)
    columns = np.broadcast_to((np.arange(int(120 * scale)) + 0.5) / scale, (int(60 * scale), int(120 * scale)))
    part = photo_part(columns, fit)
    assert part.shape == (60 * scale, 80 * scale)
    assert part.min() >= 20 and part.max() <= 100


def test_values_channels_and_layout_are_as_the_settings_say():
    photo = np.zeros((60, 80, 3), np.uint8)
    photo[:] = 255, 102, 51
    fit = fitted(CAMERA, 60, 80, "stretch")
    plain = network_input(photo, fit, network_format())
    assert plain.shape == (1, 3, 60, 80) and plain.dtype == np.float32
    np.testing.assert_allclose(plain[0, :, 7, 9], [1.0, 0.4, 0.2], rtol=1e-6)
    turned = network_input(photo, fit, network_format(channels="bgr", layout="nhwc", white=255))
    assert turned.shape == (1, 60, 80, 3)
    np.testing.assert_allclose(turned[0, 7, 9], [51, 102, 255], rtol=1e-6)
    # mean and deviation count in the network's own order of channels
    normalised = network_input(photo, fit, network_format(channels="bgr", mean=(0.1, 0.2, 0.3), std=(0.5, 1.0, 2.0)))
    np.testing.assert_allclose(normalised[0, :, 7, 9], [0.2, 0.2, 0.35], rtol=1e-5)


def test_padding_has_the_mean_colour():
    fit = fitted(CAMERA, 60, 120, "pad")
    padded = network_input(np.zeros((60, 80, 3), np.uint8), fit, network_format(white=255))
    np.testing.assert_allclose(padded[0, :, 30, 2], FILL, rtol=1e-6)
    assert not padded[0, :, :, 20:100].any()
