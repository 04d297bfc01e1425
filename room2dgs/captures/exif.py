"""Compares the capture's focal length with the one in the photos' EXIF."""

from __future__ import annotations

import math
from collections.abc import Sequence

from room2dgs.captures.capture import Shot
from room2dgs.captures.lens import Lens
from room2dgs.captures.opened_images import opened_image
from room2dgs.captures.selection import evenly_spaced
from room2dgs.errors import InputError

EXIF_BLOCK, FOCAL_35MM = 0x8769, 0xA405
FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
MAX_RATIO = 1.4  # of focal lengths; crops and stabilisation change them by less
MOST_PHOTOS = 12  # photos of a capture


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
            millimetres = float(image.getexif().get_ifd(EXIF_BLOCK).get(FOCAL_35MM, 0))
    except InputError:
        return None
    if not 5 <= millimetres <= 1000:
        return None
    return lens.K[0, 0] / (millimetres / FILM_DIAGONAL_MM * math.hypot(*lens.known_size))
