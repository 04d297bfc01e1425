"""Photos wherever they lie: in files of their own, inside an archive, or in a video."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import Protocol

import cv2
import numpy as np

from room2dgs.captures.image_files import check_photo, color_size, read_photo, resized
from room2dgs.errors import InputError


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
        try:
            return hashlib.sha256(self.path.read_bytes()).digest()
        except OSError as error:
            raise InputError(f"{self.path} cannot be read ({error.strerror}); replace the file") from error


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


class Video:
    """A video whose frames are asked for by number, cheapest in rising order."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = Lock()
        self._capture: cv2.VideoCapture | None = None
        self._next = 0
        self._last: tuple[int, np.ndarray] | None = None

    def size(self) -> tuple[int, int]:
        """(width, height)."""
        with self._lock, self._open() as capture:
            return int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))

    def __len__(self) -> int:
        """As its header has it; some are off by a few."""
        with self._lock, self._open() as capture:
            return max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT)))

    def frame(self, index: int) -> np.ndarray:
        """(H, W, 3) uint8 RGB of a frame, counted from 0; not turned by an orientation tag.

        Raises:
            InputError: no such frame, or no video.
        """
        with self._lock:
            if self._last is not None and self._last[0] == index:
                return self._last[1]
            if self._capture is not None and index < self._next:
                self._capture.release()
                self._capture = None
            with self._open() as capture:
                # Seeking lands on another frame in many videos: frames between are decoded.
                while self._next < index and capture.grab():
                    self._next += 1
                good, image = capture.read() if self._next == index else (False, None)
                if not good:
                    raise InputError(f"{self.path} ends before frame {index}; copy the video again")
                self._next = index + 1
                self._last = index, cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
                return self._last[1]

    @contextmanager
    def _open(self) -> Iterator[cv2.VideoCapture]:
        if self._capture is None:
            capture = cv2.VideoCapture(str(self.path))
            capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
            if not self.path.is_file() or not capture.isOpened():
                raise InputError(f"{self.path} cannot be read as a video; replace the file")
            self._capture, self._next = capture, 0
        yield self._capture


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
