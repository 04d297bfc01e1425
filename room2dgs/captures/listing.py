"""The names in a capture's folder; each folder is listed once, so that tens of thousands of photos cost little."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable
from fnmatch import fnmatch
from functools import lru_cache
from pathlib import Path

from room2dgs.captures.opened_images import HEIC_IS_READ_BY, heic_is_read, opened_image
from room2dgs.errors import InputError

HEIC_SUFFIXES = (".heic", ".heif", ".hif")
PHOTO_SUFFIXES = (
    ".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", *(HEIC_SUFFIXES if heic_is_read() else ()),
)  # fmt: skip
# of photos that are not read
RAW_SUFFIXES = (
    ".dng", ".raw", ".cr2", ".cr3", ".nef", ".nrw", ".arw", ".orf", ".rw2", ".raf", ".pef", ".srw", ".x3f", ".3fr",
)  # fmt: skip
OTHER_SUFFIXES = (".avif", ".jxl", ".jp2", ".j2k", ".jfif", ".gif", ".ppm", ".pgm", ".tga", ".psd", ".insp")
MESH_SUFFIXES = (".ply", ".obj", ".off", ".stl", ".glb")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".avi", ".m4v", ".webm")
_PARTS = re.compile(r"(\d+)")


class Listing:
    """A capture's folder, or the one file that it is.

    Attributes:
        root: its path.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._names = lru_cache(maxsize=None)(listed)

    def __contains__(self, path: str) -> bool:
        """Is there a file or folder of this name, which may have slashes?"""
        if self.root.is_file():
            return False
        folder, _, name = path.rpartition("/")
        return name in self._names(self.root / folder if folder else self.root)

    def matching(self, pattern: str) -> list[str]:
        """Names in the folder itself that match a pattern, in natural order; of a file its own."""
        names = (self.root.name,) if self.root.is_file() else self._names(self.root)
        return natural(name for name in names if fnmatch(name, pattern))

    def with_suffix(self, suffixes: Iterable[str]) -> list[str]:
        """Names in the folder itself with one of these endings, whatever their case, in natural order."""
        names = (self.root.name,) if self.root.is_file() else self._names(self.root)
        return natural(name for name in names if Path(name).suffix.lower() in suffixes)


def listed(folder: Path) -> frozenset[str]:
    """Names in a folder; none if there is no such folder. What hides behind a dot does not count.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return frozenset(name for name in os.listdir(folder) if not name.startswith("."))
    except (FileNotFoundError, NotADirectoryError):
        return frozenset()
    except OSError as error:
        raise InputError(f"{folder} cannot be read ({error.strerror}); check the folder's rights") from error


def natural(names: Iterable[str]) -> list[str]:
    """Sorted as people count: img2 before img10."""
    return sorted(names, key=lambda name: ([_part(text) for text in _PARTS.split(name)], name))


def _part(text: str) -> tuple[int, int, str]:
    return (0, int(text[:4000]), "") if text.isascii() and text.isdigit() else (1, 0, text)


def photos_in(folder: Path) -> list[str]:
    """Names of the photos in a folder, in natural order.

    Of a photo that is there as HEIC and converted, the latter; of HEIC only what can be opened (`unread_photos`).
    """
    names = [name for name in listed(folder) if _suffix(name) in PHOTO_SUFFIXES]
    others = {Path(name).stem for name in names if _suffix(name) not in HEIC_SUFFIXES}
    return natural(
        name
        for name in names
        if _suffix(name) not in HEIC_SUFFIXES or (Path(name).stem not in others and _opens(folder / name))
    )


def unread_photos(folder: Path) -> str | None:
    """A sentence on the files of a folder that are photos by their endings and are not read; None: there are none.

    Those do not count that are there in a format that is read too: a camera's raw files beside its JPEGs.
    """
    names = listed(folder)
    read = {Path(name).stem for name in names if _suffix(name) in PHOTO_SUFFIXES and _suffix(name) not in HEIC_SUFFIXES}
    kinds = Counter(kind for name in names if Path(name).stem not in read and (kind := _unread_kind(folder / name)))
    if not kinds:
        return None
    (first, count), *more = sorted(kinds.items())
    message = f"{count} {'file' if count == 1 else 'files'} in {folder} {'is' if count == 1 else 'are'} {first}"
    message += "".join(f", {count} {kind}" for kind, count in more)
    if set(kinds) == {"HEIC"}:
        mend = "none of them can be opened, copy them again" if heic_is_read() else HEIC_IS_READ_BY
        return f"{message}, which is not read; {mend} or convert them"
    return f"{message}, which is not read; convert them to JPEG or PNG"


def _unread_kind(path: Path) -> str | None:
    """What a file is called that is a photo by its ending and is not read."""
    suffix = _suffix(path.name)
    if suffix in HEIC_SUFFIXES:
        return None if suffix in PHOTO_SUFFIXES and _opens(path) else "HEIC"
    return suffix if suffix in RAW_SUFFIXES or suffix in OTHER_SUFFIXES else None


def _opens(path: Path) -> bool:
    try:
        with opened_image(path):
            return True
    except InputError:
        return False


def _suffix(name: str) -> str:
    return Path(name).suffix.lower()


def gt_mesh_in(root: Path, *patterns: str, own: bool = True) -> Path | None:
    """The first file that a pattern finds, the patterns in their order.

    Args:
        own: gt_mesh.ply, or another kind of mesh of that name, which is ours, comes before all of them.
    """
    names = listed(root)
    for pattern in (tuple(f"gt_mesh{end}" for end in MESH_SUFFIXES) if own else ()) + patterns:
        found = sorted(name for name in names if fnmatch(name, pattern))
        if found:
            return root / found[0]
    return None


DRIVE = re.compile(r"[A-Za-z]:[\\/]")  # of Windows
LONGEST_NAME, LONGEST_PATH = 240, 4000  # bytes; file systems take 255 and 4095, and a reader may add a suffix


def inside(root: Path, name: str, source: object) -> Path:
    """A path that a capture's file names, relative to it; it may not lead out of the capture.

    Raises:
        InputError: it does.
    """
    if not name.strip() or not name.isprintable():
        raise InputError(f"{source} names the file {name!r}, which cannot be; write its path relative to the capture")
    if DRIVE.match(name):
        raise InputError(f"{source} names {name}, a path of another machine; write paths relative to the capture")
    path = root / name.replace("\\", "/")
    if max(len(os.fsencode(part)) for part in path.parts) > LONGEST_NAME or len(os.fsencode(path)) > LONGEST_PATH:
        raise InputError(f"{source} names the file {name[:40]}..., which is too long for a file's name; write its path")
    plain = Path(os.path.normpath(path))
    if not plain.is_relative_to(os.path.normpath(root)):
        raise InputError(f"{source} names {name}, which lies outside {root}; write paths relative to the capture")
    return plain
