"""A photo's size, transparency and EXIF orientation from its header."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import NamedTuple

from PIL import Image

from room2dgs.captures.opened_images import DAMAGE, opened_image
from room2dgs.captures.photos import Photo, PhotoBytes, PhotoFile

ORIENTATION = 0x0112  # of EXIF; 1: as stored


class PhotoHeader(NamedTuple):
    """Of a photo as it is stored.

    Attributes:
        size: (width, height).
        transparent: pixels have an alpha.
        orientation: 1..8, as EXIF counts.
    """

    size: tuple[int, int]
    transparent: bool = False
    orientation: int = 1


@contextmanager
def opened(photo: Photo) -> Iterator[Image.Image | None]:
    """A photo's image file, of which the header is read; None where it is no plain file (a frame of a video).

    Raises:
        InputError: it cannot be decoded, here or inside of the block.
    """
    if type(photo) is PhotoFile:
        with opened_image(photo.path) as image:
            yield image
    elif type(photo) is PhotoBytes:
        with opened_image(BytesIO(photo.read()), photo.label) as image:
            yield image
    else:
        yield None


def header_of(photo: Photo) -> PhotoHeader:
    """What the header says; of a frame of a video its size alone.

    Raises:
        InputError: it cannot be read.
    """
    with opened(photo) as image:
        if image is None:
            return PhotoHeader(photo.size())
        return PhotoHeader(image.size, image.has_transparency_data, _orientation(image))


def _orientation(image: Image.Image) -> int:
    try:
        value = image.getexif().get(ORIENTATION, 1)
    except DAMAGE:  # a photo may be good whose EXIF is not
        return 1
    return value if isinstance(value, int) and 1 <= value <= 8 else 1
