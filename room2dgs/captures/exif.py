"""What a photo's own EXIF says of its lens, against the capture's intrinsics."""

from __future__ import annotations

import math

from PIL import Image

from room2dgs.captures.capture import Shot
from room2dgs.captures.image_files import DAMAGE
from room2dgs.captures.lens import Lens

EXIF_BLOCK, FOCAL_35MM = 0x8769, 0xA405
FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
MAX_RATIO = 1.4  # of focal lengths; crops and stabilisation change them by less


def focal_doubt(shot: Shot, lens: Lens) -> str | None:
    """A sentence if the photo's focal length, as its EXIF has it for 35 mm film, is far from the intrinsics'."""
    if shot.photo is not None:
        return None
    try:
        with Image.open(shot.path) as image:
            millimetres = float(image.getexif().get_ifd(EXIF_BLOCK).get(FOCAL_35MM, 0))
    except (*DAMAGE, TypeError, KeyError):
        return None
    if not 5 <= millimetres <= 1000:
        return None
    expected = millimetres / FILM_DIAGONAL_MM * math.hypot(*lens.size)
    ratio = lens.K[0, 0] / expected
    if 1 / MAX_RATIO <= ratio <= MAX_RATIO:
        return None
    cx, cy = lens.K[:2, 2]
    return (
        f"intrinsics: focal length {lens.K[0, 0]:.0f} px, but EXIF of {shot.path.name} says about {expected:.0f} px; "
        f"if meshes look bent, give scene.intrinsics=[{expected:.0f},{expected:.0f},{cx:.1f},{cy:.1f}]"
    )
