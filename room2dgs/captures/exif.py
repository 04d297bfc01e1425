"""The focal length in a photo's EXIF, and whether a capture's is far from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from PIL import Image

from room2dgs.captures.capture import Shot
from room2dgs.captures.devices import device_film_mm
from room2dgs.captures.lens import Lens
from room2dgs.captures.opened_images import opened_image
from room2dgs.captures.selection import evenly_spaced
from room2dgs.errors import InputError

EXIF_BLOCK, FOCAL_35MM = 0x8769, 0xA405
MODEL, FOCAL_MM, PLANE_RESOLUTION, PLANE_UNIT = 0x0110, 0x920A, 0xA20E, 0xA210
SIZE_WHEN_TAKEN = 0xA002, 0xA003
UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # of a sensor's pixels; EXIF's own default is an inch
FILM_MM = 5.0, 1000.0  # focal lengths for 35 mm film that a lens may have
FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
MAX_RATIO = 1.4  # of focal lengths; crops and stabilisation change them by less
MOST_PHOTOS = 12  # photos of a capture


def exif_focal_px(exif: Image.Exif, size: tuple[int, int]) -> float | None:
    """Focal length in pixels of a photo of this size (width, height), in either orientation; None: it is not told.

    The first that is there of: the focal length for 35 mm film, which is of the diagonal; the focal length with the
    sensor's pixels a millimetre; the device's main camera. Photos that were cropped tell a wrong one.
    """
    block = exif.get_ifd(EXIF_BLOCK)
    film_mm = _film_mm(block.get(FOCAL_35MM))
    if film_mm is None:
        focal_px = _by_sensor(block, size)
        if focal_px is not None:
            return focal_px
        film_mm = device_film_mm(str(exif.get(MODEL, "")), _number(block.get(FOCAL_MM)))
    return None if film_mm is None else film_mm / FILM_DIAGONAL_MM * math.hypot(*size)


def _film_mm(value: Any) -> float | None:
    millimetres = _number(value)
    return millimetres if millimetres is not None and FILM_MM[0] <= millimetres <= FILM_MM[1] else None


def _by_sensor(block: Mapping[int, Any], size: tuple[int, int]) -> float | None:
    """From the lens' focal length and the sensor's pixels, of which a photo that was made smaller has fewer."""
    lens_mm, pixels_a_unit = _number(block.get(FOCAL_MM)), _number(block.get(PLANE_RESOLUTION))
    unit_mm = UNIT_MM.get(block.get(PLANE_UNIT, 2))
    if lens_mm is None or pixels_a_unit is None or unit_mm is None:
        return None
    taken = max(_number(block.get(tag)) or 0.0 for tag in SIZE_WHEN_TAKEN) or max(size)
    focal_px = lens_mm * pixels_a_unit / unit_mm * max(size) / taken
    film_mm = focal_px / math.hypot(*size) * FILM_DIAGONAL_MM
    return focal_px if FILM_MM[0] <= film_mm <= FILM_MM[1] else None


def _number(value: Any) -> float | None:
    """A positive number; fractions in EXIF may have a denominator of 0, and files hold anything."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def focal_doubt(shots: Sequence[tuple[Shot, Lens]]) -> str | None:
    """A sentence if the focal length that EXIF has for 35 mm film is far from the intrinsics'.

    EXIF is often wrong (zoomed, cropped or edited photos), so this is a doubt and no error. Asked are a few photos;
    the median of those that have EXIF counts.
    """
    sampled = evenly_spaced(shots, MOST_PHOTOS)
    found = [(ratio, shot, lens) for shot, lens in sampled if (ratio := _ratio(shot, lens)) is not None]
    if not found:
        return None
    ratio, shot, lens = sorted(found, key=lambda entry: entry[0])[len(found) // 2]
    if 1 / MAX_RATIO <= ratio <= MAX_RATIO:
        return None
    K, expected = lens.K, lens.K[0, 0] / ratio
    return (
        f"the intrinsics' focal length is {K[0, 0]:.0f} px, but EXIF of {shot.path.name} says about {expected:.0f} px; "
        "if walls look bent or the room too deep or too flat, give "
        f"scene.intrinsics=[{expected:.0f},{expected * K[1, 1] / K[0, 0]:.0f},{K[0, 2]:.1f},{K[1, 2]:.1f}]"
    )


def _ratio(shot: Shot, lens: Lens) -> float | None:
    """Focal length of the intrinsics by that of the EXIF; None: the photo has none."""
    if shot.photo is not None:
        return None
    try:
        with opened_image(shot.path) as image:
            focal_px = exif_focal_px(image.getexif(), lens.known_size)
    except InputError:
        return None
    return None if focal_px is None else lens.K[0, 0] / focal_px
