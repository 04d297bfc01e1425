"""depth.bin of ScanNet++'s iPhone: 192x256 pixels a frame, packed in one of two ways.

Either the file is one raw deflate stream of float32 metres, or each frame has its packed size (uint32) before an LZ4
block of uint16 millimetres or a raw deflate stream of float32 metres.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

import numpy as np

from room2dgs.errors import InputError
from room2dgs.regular_files import check_regular, open_regular

HEIGHT, WIDTH = 192, 256
METRES_BYTES, MM_BYTES = 4 * HEIGHT * WIDTH, 2 * HEIGHT * WIDTH
FIRST, CHUNK = 1 << 18, 1 << 16  # bytes by which one stream is told, and that are unpacked at a time
MAX_FRAMES = 500_000
MARK_EVERY = 64  # frames; from a mark unpacking goes on, so that a frame costs so many at most


class DepthStream:
    """The frames of a depth.bin by number, cheapest in rising order; one at a time is in memory.

    One stream of deflate has no frames to jump to: the unpacker's state is kept at some, 0.1 MB each.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = Lock()
        self._whole: bool | None = None
        self._file: BinaryIO | None = None
        self._next = 0
        self._unpacker: Any = None  # zlib's, whose type has no name
        self._marks: list[tuple[int, Any]] = []  # place in the file and unpacker of frame 0, MARK_EVERY, ...
        self._last: tuple[int, bytes] | None = None
        self._places: list[tuple[int, int]] = []

    def frame(self, index: int) -> np.ndarray:
        """(192, 256) float32 metres.

        Raises:
            InputError: it is damaged or has no such frame.
        """
        with self._lock:
            try:
                if self._whole is None:
                    self._whole = self._is_one_stream()
                return self._streamed(index) if self._whole else self._packed(index)
            except (OSError, zlib.error, struct.error) as error:
                self._unpacker = None
                raise self._damaged(index) from error

    def _damaged(self, index: int) -> InputError:
        return InputError(f"{self.path} cannot be unpacked up to frame {index}; download it again or delete it")

    def _is_one_stream(self) -> bool:
        with open_regular(self.path) as file:
            try:
                return len(zlib.decompressobj(-zlib.MAX_WBITS).decompress(file.read(FIRST), METRES_BYTES)) > MM_BYTES
            except zlib.error:
                return False

    def _streamed(self, index: int) -> np.ndarray:
        if self._last is None or self._last[0] != index:
            self._last = index, self._unpacked_to(index)
        return np.frombuffer(self._last[1], "<f4").reshape(HEIGHT, WIDTH)

    def _unpacked_to(self, index: int) -> bytes:
        if self._file is None:
            self._file = open_regular(self.path)
            self._marks = [(0, zlib.decompressobj(-zlib.MAX_WBITS))]
        mark = min(index // MARK_EVERY, len(self._marks) - 1)
        if self._unpacker is None or not mark * MARK_EVERY <= self._next <= index:
            place, unpacker = self._marks[mark]
            self._file.seek(place)
            self._next, self._unpacker = mark * MARK_EVERY, unpacker.copy()
        data = b""
        while self._next <= index:
            data = self._unpacked(METRES_BYTES)
            if len(data) < METRES_BYTES:
                self._unpacker = None
                raise self._damaged(index)
            self._next += 1
            if self._next == len(self._marks) * MARK_EVERY:
                self._marks.append((self._file.tell(), self._unpacker.copy()))
        return data

    def _unpacked(self, size: int) -> bytes:
        """The next bytes; fewer at the file's end."""
        assert self._file is not None
        parts, missing = [], size
        while missing:
            packed = self._unpacker.unconsumed_tail or self._file.read(CHUNK)
            part = self._unpacker.decompress(packed, missing)
            if not part and not packed:
                break
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _packed(self, index: int) -> np.ndarray:
        if not self._places:
            self._places = self._scanned()
        if index >= len(self._places):
            raise self._damaged(index)
        start, size = self._places[index]
        with open_regular(self.path) as file:
            file.seek(start)
            data = file.read(size)
        try:
            metres = zlib.decompressobj(-zlib.MAX_WBITS).decompress(data, METRES_BYTES + 1)
            if len(metres) == METRES_BYTES:
                return np.frombuffer(metres, "<f4").reshape(HEIGHT, WIDTH)
        except zlib.error:
            pass
        values = lz4_block(data, MM_BYTES)
        if values is None:
            raise self._damaged(index)
        return np.frombuffer(values, "<u2").reshape(HEIGHT, WIDTH).astype(np.float32) / 1000

    def _scanned(self) -> list[tuple[int, int]]:
        places: list[tuple[int, int]] = []
        length = check_regular(self.path)
        with open_regular(self.path) as file:
            while file.tell() + 4 <= length:
                (size,) = struct.unpack("<I", file.read(4))
                start = file.tell()
                if not 0 < size <= min(length - start, 2 * METRES_BYTES) or len(places) == MAX_FRAMES:
                    break
                places.append((start, size))
                file.seek(start + size)
        return places


def lz4_block(data: bytes, size: int) -> bytes | None:
    """Unpack an LZ4 block of a known size (LZ4's block format); None if it is none."""
    out, place, end = bytearray(), 0, len(data)
    while place < end:
        token = data[place]
        place += 1
        literals, place = _length(token >> 4, data, place)
        if literals is None or place + literals > end or len(out) + literals > size:
            return None
        out += data[place : place + literals]
        place += literals
        if place == end:
            break
        offset = int.from_bytes(data[place : place + 2], "little")
        matched, place = _length(token & 15, data, place + 2)
        if matched is None or not 0 < offset <= len(out) or len(out) + matched + 4 > size:
            return None
        matched += 4
        piece = bytes(out[-offset:])[:matched]
        out += (piece * (matched // len(piece) + 1))[:matched]
    return bytes(out) if len(out) == size else None


def _length(nibble: int, data: bytes, place: int) -> tuple[int | None, int]:
    """15 says that bytes follow, up to the first below 255."""
    length = nibble
    while nibble == 15:
        if place >= len(data):
            return None, place
        length += data[place]
        place += 1
        if data[place - 1] < 255:
            break
    return length, place
