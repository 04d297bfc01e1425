"""Photos from files, archives and videos behind one interface."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Protocol

import numpy as np

from room2dgs.captures.image_files import check_photo, color_size, read_photo, resized
from room2dgs.captures.video import Video
from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular

CHUNK = 1 << 20


class Photo(Protocol):
    """A photo that is decoded when it is asked for. Every method raises InputError if it cannot be."""

    def size(self) -> tuple[int, int]:
        """(width, height) as stored."""

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        """(H, W, 3) uint8 RGB, area-averaged to a size (None: as stored)."""

    def check(self) -> None:
        """Read it to its end."""

    def digest(self) -> bytes:
        """Stands for its content."""


@dataclass(frozen=True)
class PhotoFile:
    """An image file."""

    path: Path

    def size(self) -> tuple[int, int]:
        return color_size(self.path)

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        return read_photo(self.path, size)

    def check(self) -> None:
        check_photo(self.path)

    def digest(self) -> bytes:
        found = hashlib.sha256()
        with open_regular(self.path) as file:
            try:
                while data := file.read(CHUNK):
                    found.update(data)
            except OSError as error:
                raise InputError(f"{self.path} cannot be read ({error.strerror}); replace the file") from error
        return found.digest()


@dataclass(frozen=True)
class PhotoBytes:
    """An encoded image inside another file.

    Attributes:
        label: what messages call it.
        read: its bytes, read anew each time.
    """

    label: str
    read: Callable[[], bytes] = field(compare=False)

    def size(self) -> tuple[int, int]:
        return color_size(BytesIO(self.read()), self.label)

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        return read_photo(BytesIO(self.read()), size, self.label)

    def check(self) -> None:
        check_photo(BytesIO(self.read()), self.label)

    def digest(self) -> bytes:
        return hashlib.sha256(self.read()).digest()


@dataclass(frozen=True)
class VideoFrame:
    """One frame of a video."""

    video: Video
    index: int

    def size(self) -> tuple[int, int]:
        return self.video.size()

    def pixels(self, size: tuple[int, int] | None = None) -> np.ndarray:
        return resized(self.video.frame(self.index), size)

    def check(self) -> None:
        self.video.frame(self.index)

    def digest(self) -> bytes:
        return hashlib.sha256(self.video.frame(self.index).tobytes()).digest()
