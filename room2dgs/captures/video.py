"""Frames of a video by number; a file is a video by its first bytes."""

from __future__ import annotations

import os
from collections import Counter, OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Condition

import cv2
import numpy as np

from room2dgs.captures.opened_images import MOST_PIXELS, begins
from room2dgs.errors import InputError
from room2dgs.regular_files import check_regular, open_regular

CONTAINERS = "MP4, MOV, MKV, WebM, AVI and MPEG"
MEND = "convert it to H.264 in .mp4"
# QuickTime's files may begin with any of its boxes
_BOXES = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"pnot")
KEPT_BYTES = 64 << 20  # of decoded frames that were handed out or passed


def open_video(path: Path, upright: bool) -> cv2.VideoCapture:
    """A video, opened by FFmpeg as a file of its own: playlists and lists of parts, which name other files, are not.

    Args:
        upright: frames are turned as the header says.

    Raises:
        InputError: no regular file, no video's container, or damaged.
    """
    _check_container(path)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is wrong with a file is ours to say
    # an absolute path is no address ("concat:a|b"), and FFmpeg takes no %d for a number as OpenCV's pictures do
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # so it is for OpenCV
    try:
        capture = cv2.VideoCapture(os.path.abspath(path), cv2.CAP_FFMPEG)
    finally:
        cv2.utils.logging.setLogLevel(level)
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1 if upright else 0)
    if not capture.isOpened():
        capture.release()
        raise InputError(f"{path} cannot be read as a video: it is damaged or of a codec that is not read; {MEND}")
    width, height = _size(capture)
    if not 0 < width * height <= MOST_PIXELS:
        capture.release()
        raise InputError(f"{path} has frames of {width}x{height} pixels, which are not read; {MEND}")
    return capture


def is_container(head: bytes) -> bool:
    """Whether a file's first 512 bytes are those of a video's container."""
    if head[4:8] in _BOXES or head.startswith((b"\x1a\x45\xdf\xa3", b"\0\0\x01\xba", b"\0\0\x01\xb3")):
        return True
    if head.startswith(b"RIFF") and head[8:12] == b"AVI ":
        return True
    return head[:1] == b"G" == head[188:189] or head[4:5] == b"G" == head[196:197]  # MPEG's transport streams


def _check_container(path: Path) -> None:
    mend = "give the path of a video"
    if not check_regular(path, mend):
        raise InputError(f"{path} is empty (0 bytes); copy the video again")
    with open_regular(path, mend) as file:
        head = file.read(512)
    if not is_container(head):
        raise InputError(
            f"{path} cannot be read as a video: it is none of {CONTAINERS} (it begins {begins(head)}); {MEND}"
        )


def _size(capture: cv2.VideoCapture) -> tuple[int, int]:
    return int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))


class Video:
    """A video whose frames are asked for by number, cheapest in rising order.

    Seeking lands on another frame in many videos, so all frames up to the one that is wanted are decoded. Threads may
    ask for frames together in any order near to each other: whoever decodes keeps what the others wait for, and what
    was handed out or passed last.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._changed = Condition()  # guards all but `_capture` and `_next`, which belong to who decodes
        self._busy = False
        self._wanted: Counter[int] = Counter()
        self._found: dict[int, np.ndarray] = {}  # of those that are wanted
        self._kept: OrderedDict[int, np.ndarray] = OrderedDict()
        self._end: int | None = None
        self._out_of_order = False
        self._capture: cv2.VideoCapture | None = None
        self._next = 0

    def size(self) -> tuple[int, int]:
        """(width, height).

        Raises:
            InputError: no video.
        """
        with self._alone():
            return _size(self._opened())

    def __len__(self) -> int:
        """As its header has it; some are off by a few."""
        with self._alone():
            return max(0, int(self._opened().get(cv2.CAP_PROP_FRAME_COUNT)))

    def frame(self, index: int) -> np.ndarray:
        """(H, W, 3) uint8 RGB of a frame, counted from 0; not turned by an orientation tag.

        Raises:
            InputError: no such frame, or no video.
        """
        with self._changed:
            self._wanted[index] += 1
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: not self._busy or self._is_there(index))
                    if self._is_there(index):
                        return self._there(index)
                    self._busy = True
                with self._alone(mine=True):
                    self._decode_to(index)
        finally:
            with self._changed:
                self._wanted[index] -= 1
                if not self._wanted[index]:
                    del self._wanted[index]
                    self._found.pop(index, None)

    @contextmanager
    def _alone(self, mine: bool = False) -> Iterator[None]:
        """The one who decodes; with `mine` that is settled already."""
        if not mine:
            with self._changed:
                self._changed.wait_for(lambda: not self._busy)
                self._busy = True
        try:
            yield
        finally:
            with self._changed:
                self._busy = False
                self._changed.notify_all()

    def _is_there(self, index: int) -> bool:
        return index in self._found or index in self._kept or (self._end is not None and index >= self._end)

    def _there(self, index: int) -> np.ndarray:
        if index in self._kept:
            self._kept.move_to_end(index)
            return self._kept[index]
        if index in self._found:
            return self._found[index]
        raise InputError(f"{self.path} ends before frame {index}; copy the video again")

    def _decode_to(self, index: int) -> None:
        """Decode up to a frame, and keep what anybody waits for on the way."""
        if self._capture is not None and index < self._next:
            self._release()
            self._out_of_order = True
        capture = self._opened()
        while self._next <= index:
            good = capture.grab()
            wanted = good and self._is_wanted(self._next, index)
            image = None
            if wanted:
                good, image = capture.retrieve()
            if not good:
                with self._changed:
                    self._end = self._next
                self._release()
                return
            if image is not None:
                self._keep(self._next, cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
            self._next += 1

    def _is_wanted(self, number: int, index: int) -> bool:
        """Frames on the way to `index` that others wait for, or may ask for next: who asks out of order once, or
        several together, may do so again. Of the latter only those right before it are kept.
        """
        with self._changed:
            self._out_of_order |= len(self._wanted) > 1
            if number == index or number in self._wanted:
                return True
            return self._out_of_order and index - number < self._room()

    def _room(self) -> int:
        """Frames that fit into what is kept."""
        width, height = _size(self._opened())
        return KEPT_BYTES // max(1, 3 * width * height)

    def _keep(self, number: int, image: np.ndarray) -> None:
        with self._changed:
            if number in self._wanted:
                self._found[number] = image
            self._kept[number] = image
            while len(self._kept) > max(1, KEPT_BYTES // image.nbytes):
                self._kept.popitem(last=False)

    def _opened(self) -> cv2.VideoCapture:
        if self._capture is None:
            self._capture, self._next = open_video(self.path, upright=False), 0
        return self._capture

    def _release(self) -> None:
        if self._capture is not None:
            self._capture.release()
        self._capture = None
