"""The focal length that a photo's EXIF tells, by the first of three ways that is there."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from room2dgs.captures.devices import MAIN_CAMERAS
from room2dgs.captures.exif import EXIF_BLOCK, exif_focal_px

SIZE = (4032, 3024)
DIAGONAL = math.hypot(*SIZE)


def exif(model: str | None = None, **tags) -> Image.Exif:
    numbers = {"film": 0xA405, "focal": 0x920A, "resolution": 0xA20E, "unit": 0xA210, "width": 0xA002, "height": 0xA003}
    made = Image.Exif()
    if model is not None:
        made[0x0110] = model
    made.get_ifd(EXIF_BLOCK).update({numbers[name]: value for name, value in tags.items()})
    return made


def test_film_is_of_the_diagonal_and_comes_first():
    assert exif_focal_px(exif(film=26, focal=4.25, resolution=99.0), SIZE) == pytest.approx(
        26 / 43.267 * DIAGONAL, 1e-4
    )


@pytest.mark.parametrize(("unit", "a_unit"), [(2, 25.4), (3, 10.0), (4, 1.0), (None, 25.4)])
def test_a_sensor_of_known_pixels_tells_it(unit, a_unit):
    # 4.25 mm on a sensor with 700 pixels a millimetre
    tags = {"focal": IFDRational(425, 100), "resolution": 700.0 * a_unit, "width": 4032, "height": 3024}
    tags |= {} if unit is None else {"unit": unit}
    assert exif_focal_px(exif(**tags), SIZE) == pytest.approx(4.25 * 700)
    assert exif_focal_px(exif(**tags), (1008, 756)) == pytest.approx(4.25 * 700 / 4)  # made smaller
    assert exif_focal_px(exif(**tags), (3024, 4032)) == pytest.approx(4.25 * 700)  # turned


def test_a_device_tells_that_of_its_main_camera_alone():
    assert exif_focal_px(exif("iPhone 11", focal=4.25), SIZE) == pytest.approx(26 / 43.267 * DIAGONAL, 1e-4)
    assert exif_focal_px(exif("iPhone 11"), SIZE) is not None
    assert exif_focal_px(exif("iPhone 11", focal=1.54), SIZE) is None  # the ultra wide one
    assert exif_focal_px(exif("Box Brownie", focal=4.25), SIZE) is None
    assert all(20 < film < 35 and film / mm < 9 for film, mm in MAIN_CAMERAS.values())


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {"film": 0},
        {"film": 40000},
        {"focal": IFDRational(4, 0), "resolution": 700.0, "unit": 4},
        {"focal": 4.25, "resolution": 0, "unit": 4},
        {"focal": 4.25, "resolution": 700.0, "unit": 77},
        {"focal": 4.25, "resolution": 1e9, "unit": 4},
        {"focal": b"wide", "resolution": "many", "unit": 4},
    ],
)
def test_what_cannot_be_tells_nothing(tags):
    assert exif_focal_px(exif(**tags), SIZE) is None


anything = st.one_of(
    st.none(), st.integers(), st.floats(), st.text(max_size=3), st.binary(max_size=3), st.tuples(st.integers())
)


@given(film=anything, focal=anything, resolution=anything, unit=anything, width=anything)
def test_no_exif_stops_a_capture(film, focal, resolution, unit, width):
    found = exif_focal_px(exif(film=film, focal=focal, resolution=resolution, unit=unit, width=width), SIZE)
    assert found is None or 5 / 43.3 * DIAGONAL < found < 1001 / 43.2 * DIAGONAL
