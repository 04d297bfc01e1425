"""Scale and registration of depth files against sparse points."""

from __future__ import annotations

import re

import numpy as np
import pytest

from room2dgs.captures.seen_points import SeenPoints
from room2dgs.depth.sensor.at_points import AtPoints, at_points, moves
from room2dgs.depth.sensor.registration import check_scale, fitting_unit, found_shift, scale_warning
from room2dgs.errors import InputError

WIDTH, HEIGHT = 160, 120


def bumpy(view: int) -> np.ndarray:
    """(H, W) metres, smooth, different in every view."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return (2.0 + 0.4 * np.sin(0.2 * x + view) + 0.3 * np.cos(0.17 * y - view)).astype(np.float32)


def seen(depth: np.ndarray, view: int, noise: float = 0.0, wrong: float = 0.0) -> SeenPoints:
    rng = np.random.default_rng(view)
    row, column = rng.integers(0, HEIGHT, 200), rng.integers(0, WIDTH, 200)
    z = depth[row, column] * (1 + noise * rng.normal(size=200))
    z = np.where(rng.random(200) < wrong, rng.uniform(0.5, 5.0, 200), z)
    return SeenPoints(np.arange(200), np.stack([column, row], axis=1) + 0.5, z.astype(np.float64))


def views(right: int = 0, down: int = 0, scale: float = 1.0, count: int = 8, **errors) -> list[AtPoints]:
    """Maps moved and scaled against the points."""
    found = []
    for view in range(count):
        depth = bumpy(view)
        found.append(at_points(scale * np.roll(depth, (down, right), (0, 1)), seen(depth, view, **errors)))
    return found


def test_maps_that_fit_have_scale_one_and_no_shift_in_spite_of_wrong_points():
    fitting = views(noise=0.01, wrong=0.2)
    assert check_scale(fitting, 0.001).value == pytest.approx(1.0, abs=0.005)
    assert found_shift(fitting, WIDTH) is None


@pytest.mark.parametrize(("right", "down"), [(3, 0), (-2, 0), (0, 2), (2, -3)])
def test_a_shift_is_found_with_its_direction(right, down):
    # to bring the map back it has to move the other way
    assert found_shift(views(right, down, noise=0.01, wrong=0.2), WIDTH) == (-right, -down)


def test_one_pixel_is_no_shift():
    assert found_shift(views(1, 0, noise=0.01), WIDTH) is None


def test_a_shift_is_found_under_a_wrong_scale_and_does_not_hide_it():
    shifted = views(3, 0, scale=1.02, noise=0.01)
    assert found_shift(shifted, WIDTH) == (-3, 0)
    assert check_scale(shifted, 0.001).value == pytest.approx(1.02, abs=0.01)


def test_too_few_views_or_points_say_nothing():
    assert found_shift(views(3, 0, count=3), WIDTH) is None
    few = [AtPoints(np.full(10, 1000.0), np.full((5, 5), np.nan))]
    assert check_scale(few, 0.001) is None
    assert check_scale([], 0.001) is None


@pytest.mark.parametrize(
    ("scale", "unit", "said"),
    [
        (1000.0, 1.0, "prior.depth.unit_m=0.001 (now 1)"),  # millimetres read as metres
        (5.0, 0.001, "prior.depth.unit_m=0.0002 (now 0.001)"),
        (6.5535, 0.001, "prior.depth.unit_m=0.00015259 (now 0.001)"),
        (1.2, 0.001, "prior.depth.unit_m=0.00083"),
        (0.85, 0.001, "prior.depth.unit_m=0.00117"),
    ],
)
def test_another_scale_is_refused_with_the_unit_that_fits(scale, unit, said):
    with pytest.raises(InputError) as refused:
        check_scale(views(scale=scale, noise=0.01, wrong=0.2), unit)
    assert said in str(refused.value)
    factor = float(re.search(r"scene\.unit=(\S+) \(times", str(refused.value))[1])
    assert factor == pytest.approx(scale, rel=0.005)  # the poses may be what is wrong
    assert "prior/depth=room_prior" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_a_few_per_cent_are_no_wrong_unit_and_are_said(scale):
    found = check_scale(views(scale=scale, noise=0.01, wrong=0.2), 0.001)
    assert found.value == pytest.approx(scale, rel=0.005) and found.error < 0.005
    said = scale_warning(found, 0.001)
    assert f"say {scale} (± " in said and f"prior.depth.unit_m={0.001 / scale:.5f}" in said and "\n" not in said
    assert scale_warning(check_scale(views(scale=1.02, noise=0.01), 0.001), 0.001) is None


def test_the_error_of_the_scale_is_that_of_its_median():
    """Points of five views each, all of a point's ratios off by the same."""
    random = np.random.default_rng(5)
    found = []
    for _ in range(300):
        points = 0.95 * np.exp(0.05 * random.normal(size=25))
        found.append(check_scale([AtPoints(points, np.zeros((5, 5)))] * 5, 0.001))
    errors, values = [one.error for one in found], [np.log(one.value) for one in found]
    assert np.median(errors) == pytest.approx(np.std(values), rel=0.2)


def test_few_scattered_points_do_not_refuse_what_many_do():
    random = np.random.default_rng(2)

    def scattered(count: int) -> list[AtPoints]:
        return [AtPoints(0.8 * np.exp(0.3 * random.normal(size=count)), np.zeros((5, 5)))]

    few = check_scale(scattered(40), 0.001)
    assert few.value < 0.9 and scale_warning(few, 0.001) is None  # it may as well be 1
    with pytest.raises(InputError, match="times the distances"):
        check_scale(scattered(4000), 0.001)


def test_a_unit_near_a_usual_one_is_the_usual_one():
    assert fitting_unit(0.001, 4.93) == 1 / 5000
    assert fitting_unit(0.001, 1.05) == pytest.approx(0.001 / 1.05)


def test_moves_are_whole_pixels_about_none():
    for width in (16, 80, 320, 640, 1296, 1920):
        by = moves(width)
        assert by[len(by) // 2] == 0 and (by == -by[::-1]).all()
        assert len(by) <= 19 and by[-1] >= 2
