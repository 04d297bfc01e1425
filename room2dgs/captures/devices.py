"""Main cameras of phones whose photos have lost the focal length for 35 mm film."""

from __future__ import annotations

# Model in the EXIF -> focal length for 35 mm film, and that of the lens, both in mm. The first is what Apple's pages of
# technical specifications name for the main (wide) camera, the second what that camera writes; with another one the
# photo is from another lens of the phone. Other makers' phones are not here: their photos have the first in the EXIF,
# and models of one name differ by country.
MAIN_CAMERAS: dict[str, tuple[float, float]] = {
    "iPhone 7": (28, 3.99),
    "iPhone 7 Plus": (28, 3.99),
    "iPhone 8": (28, 3.99),
    "iPhone 8 Plus": (28, 3.99),
    "iPhone X": (28, 4.0),
    "iPhone XR": (26, 4.25),
    "iPhone XS": (26, 4.25),
    "iPhone XS Max": (26, 4.25),
    "iPhone 11": (26, 4.25),
    "iPhone 11 Pro": (26, 4.25),
    "iPhone 11 Pro Max": (26, 4.25),
    "iPhone 12": (26, 4.2),
    "iPhone 12 mini": (26, 4.2),
    "iPhone 12 Pro": (26, 4.2),
    "iPhone 12 Pro Max": (26, 5.1),
    "iPhone 13": (26, 5.1),
    "iPhone 13 mini": (26, 5.1),
    "iPhone 13 Pro": (26, 5.7),
    "iPhone 13 Pro Max": (26, 5.7),
    "iPhone 14": (26, 5.7),
    "iPhone 14 Plus": (26, 5.7),
    "iPhone 14 Pro": (24, 6.86),
    "iPhone 14 Pro Max": (24, 6.86),
    "iPhone 15": (26, 5.96),
    "iPhone 15 Plus": (26, 5.96),
    "iPhone 15 Pro": (24, 6.765),
    "iPhone 15 Pro Max": (24, 6.765),
    "iPhone 16": (26, 5.96),
    "iPhone 16 Plus": (26, 5.96),
    "iPhone 16 Pro": (24, 6.765),
    "iPhone 16 Pro Max": (24, 6.765),
}
SAME_LENS = 1.08  # of focal lengths in mm


def device_film_mm(model: str, lens_mm: float | None) -> float | None:
    """Focal length for 35 mm film of a device's main camera; None: it is not known, or the photo is of another lens.

    Args:
        model: as the EXIF has it.
        lens_mm: focal length of the photo's lens; None: the EXIF has none.
    """
    film_mm, main_mm = MAIN_CAMERAS.get(model.strip("\0 "), (0.0, 0.0))
    if not film_mm or (lens_mm is not None and not 1 / SAME_LENS < lens_mm / main_mm < SAME_LENS):
        return None
    return film_mm
