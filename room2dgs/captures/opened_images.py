"""Opens image files from outside safely: regular files of known formats with a bounded number of pixels.

Decoders look at what a file holds and not at its name. Without a list of formats Pillow would hand a `.jpg` that is
PostScript to Ghostscript, which runs it.
"""

from __future__ import annotations

import os
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from PIL import Image, UnidentifiedImageError

from room2dgs.errors import InputError, first_line
from room2dgs.regular_files import open_regular
from room2dgs.texts import shown

FORMATS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "GIF", "PPM")  # of a JPEG Pillow makes an MPO where it is one
HEIC_PACKAGES = ("pi_heif", "pillow_heif")
HEIC_IS_READ_BY = "install room2dgs[heic]"
MOST_PIXELS = 160 << 20  # of a photo, decoding of which takes ten bytes a pixel; more than the next number
ANY_PIXELS, PIXELS_PER_BYTE = 64 << 20, 32  # only if its file has a byte for so many: photos have ten times as many
MOST_DEPTH_PIXELS = 1 << 25  # of a map of numbers, which takes more bytes a pixel: 7680x4320 has less
MOST_BYTES = 1 << 31  # of a file
HEAD = 64  # bytes by which a file is told
MEND = "replace the file or delete the frame"
# each of Pillow's decoders fails its own way
DAMAGE = (
    OSError, SyntaxError, ValueError, EOFError, TypeError, LookupError, ArithmeticError, MemoryError, struct.error,
    zlib.error, Image.DecompressionBombError, AssertionError,
)  # fmt: skip
# first bytes -> what they are called; place and bytes
_KINDS = (
    (0, b"\xff\xd8\xff", "JPEG"), (0, b"\x89PNG\r\n\x1a\n", "PNG"), (0, b"II*\0", "TIFF"), (0, b"MM\0*", "TIFF"),
    (8, b"WEBP", "WebP"), (0, b"BM", "BMP"), (0, b"GIF8", "GIF"), (0, b"P5", "PGM"), (0, b"P6", "PPM"),
)  # fmt: skip
# of photos that are not read, a name for the sentence
_UNREAD = (
    (0, b"\0\0\0\x0cjP  ", "JPEG 2000"), (0, b"\xff\x4f\xff\x51", "JPEG 2000"), (0, b"\0\0\0\x0cJXL ", "JPEG XL"),
    (0, b"\xff\x0a", "JPEG XL"), (4, b"ftypavis", "AVIF"), (0, b"8BPS", "Photoshop's PSD"), (0, b"v/1\x01", "OpenEXR"),
    (0, b"#?RADIANCE", "Radiance HDR"), (0, b"qoif", "QOI"),
)  # fmt: skip
_HEIC_BRANDS = (b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1")

# Pixels are limited here, and by a sentence.
warnings.filterwarnings("ignore", category=Image.DecompressionBombWarning)


@contextmanager
def opened_image(source: Path | BytesIO, label: object = None, most: int = MOST_PIXELS) -> Iterator[Image.Image]:
    """An image, whose header is read; what fails inside of the context, such as decoding, is told likewise.

    Args:
        source: a file, or its bytes.
        label: what messages call it; None: its path.
        most: pixels that it may have.

    Raises:
        InputError: no regular file, no image, one of a format that photos do not have, too large, or damaged.
    """
    label = source if label is None else label
    with _file(source) as file:
        head = file.read(HEAD)
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        if not size:
            raise InputError(f"{label} cannot be decoded: it is empty (0 bytes); {MEND}")
        if size > MOST_BYTES:
            raise InputError(f"{label} has {size >> 20} MiB, too large for an image; {MEND}")
        most = min(most, max(ANY_PIXELS, PIXELS_PER_BYTE * size))
        try:
            with Image.open(file, formats=formats()) as image:
                if image.width * image.height > most:
                    raise _too_large(label, f"{image.width}x{image.height} pixels", most)
                yield image
        except InputError:
            raise
        except Image.DecompressionBombError as error:
            raise _too_large(label, "too many pixels", most) from error
        except DAMAGE as error:
            raise _refusal(label, head, file, error) from error


def _file(source: Path | BytesIO) -> BinaryIO:
    return open_regular(source) if isinstance(source, str | os.PathLike) else BytesIO(source.getbuffer())


@lru_cache(maxsize=1)
def formats() -> tuple[str, ...]:
    """What Pillow may take a file for; with HEIC where a package for it is installed."""
    return (*FORMATS, "HEIF") if heic_is_read() else FORMATS


@lru_cache(maxsize=1)
def heic_is_read() -> bool:
    """Whether a package that reads HEIC is installed; Pillow knows of it then."""
    for name in HEIC_PACKAGES:
        try:
            import_module(name).register_heif_opener()
        except (ImportError, OSError, AttributeError):
            continue
        return True
    return False


def kind_of(head: bytes) -> str | None:
    """What a file's first bytes say that it is ("JPEG"); None: no image that is read."""
    if is_heic(head):
        return "HEIC"
    return next((kind for place, magic, kind in _KINDS if head[place : place + len(magic)] == magic), None)


def is_heic(head: bytes) -> bool:
    brands = head[8:40]  # AVIF lies in the same box
    return head[4:8] == b"ftyp" and b"avi" not in brands and any(brand in brands for brand in _HEIC_BRANDS)


def unread_kind(head: bytes) -> str | None:
    """What a file's first bytes say that it is where that is not read ("AVIF")."""
    if head[4:8] == b"ftyp" and b"avif" in head[8:40]:
        return "AVIF"
    return next((kind for place, magic, kind in _UNREAD if head[place : place + len(magic)] == magic), None)


def begins(head: bytes) -> str:
    """A file's first bytes, fit for a sentence."""
    head = head[:16]
    text = head.decode("ascii", errors="replace")
    if all(letter.isprintable() or letter in "\r\n\t" for letter in text) and "\ufffd" not in text:
        return f'"{shown(text)}"'
    return head[:8].hex(" ")


def _too_large(label: object, what: str, most: int) -> InputError:
    return InputError(f"{label} has {what}, and {most >> 20} million are read at most of such a file; make it smaller")


def _refusal(label: object, head: bytes, file: BinaryIO, error: BaseException) -> InputError:
    kind = kind_of(head)
    if kind == "HEIC" and not heic_is_read():
        return InputError(f"{label} is HEIC, which is not read; {HEIC_IS_READ_BY} or convert it to JPEG")
    unread = unread_kind(head) if kind is None else None
    if unread:
        return InputError(f"{label} is {unread}, which is not read as a photo; convert it to JPEG or PNG")
    if kind is None:
        return InputError(f"{label} cannot be decoded: it is not an image (it begins {begins(head)}); {MEND}")
    if _ends_early(kind, file):
        return InputError(f"{label} cannot be decoded: this {kind} ends too early; copy it again or delete the frame")
    if isinstance(error, UnidentifiedImageError):  # its text names Python's object
        return InputError(f"{label} cannot be decoded: this {kind} is damaged or of a kind that is not read; {MEND}")
    return InputError(f"{label} cannot be decoded: this {kind} is damaged ({first_line(error)[:80]}); {MEND}")


def _ends_early(kind: str, file: BinaryIO) -> bool:
    """Whether the mark of the end is missing from the last bytes."""
    mark = {"JPEG": b"\xff\xd9", "PNG": b"IEND"}.get(kind)
    if mark is None or file.closed:
        return False
    file.seek(-min(1024, file.seek(0, os.SEEK_END)), os.SEEK_END)
    return mark not in file.read()
