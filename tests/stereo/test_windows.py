"""Windows that cover as much of the room in photos of any width."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from room2dgs.config import StereoConfig, load_config
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.scene import matching_of


@cache
def defaults() -> StereoConfig:
    return load_config(["scene.path=a", "out=b"]).stereo


def cameras(*widths: int) -> list[Camera]:
    return [Camera(np.eye(3), width, 3 * width // 4, np.eye(4)) for width in widths]


@pytest.mark.parametrize(
    ("width", "window"), [(80, (2, 1)), (320, (2, 1)), (500, (4, 2)), (640, (4, 2)), (1296, (8, 4)), (4000, (12, 6))]
)
def test_windows_cover_as_much_of_a_wide_photo_as_of_one_of_320_pixels(width, window):
    matching = matching_of(replace(defaults(), radius=2, step=1), cameras(60, width))
    assert (matching.radius, matching.step) == window


@hypothesis_settings(deadline=None)  # the first one reads the configuration
@given(st.integers(1, 12), st.integers(1, 12), st.integers(16, 4000))
def test_wider_windows_have_as_many_samples_and_fit_the_kernels(radius, step, width):
    assume(step <= radius and radius // step <= 5)
    matching = matching_of(replace(defaults(), radius=radius, step=step), cameras(width))
    assert matching.radius // matching.step == radius // step and matching.radius % matching.step == 0
    assert step <= matching.step <= max(step, round(step * width / 320)) and matching.radius <= 12
