"""An .onnx file before anything runs it: is it one, which other files does it name, what stands for its bytes.

A model may keep its weights in other files and name any path for them, so the names are looked at here first,
by walking the file's protobuf records (onnx.proto).
"""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple

from room2dgs.errors import InputError

# record -> {field number: record that it holds}, for the records on the way to a tensor's external data
_RECORDS = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {13: "entry"},
    "entry": {},
}
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_CHUNK = 1 << 20


class ModelFile(NamedTuple):
    """A model on disk.

    Attributes:
        path: of the .onnx file.
        digest: SHA-256 over the bytes of the file and of all that it names, hexadecimal.
        bytes: of all of them.
    """

    path: Path
    digest: str
    bytes: int


def read_model(path: Path, sha256: str | None = None) -> ModelFile:
    """Check a model file and all that it names.

    Args:
        path: the .onnx file.
        sha256: what the .onnx file's own SHA-256 must be; None: anything.

    Raises:
        InputError: missing, not ONNX, another file than `sha256` says, or weights that are missing or lie outside
            the model's folder.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; give the .onnx file of a network")
    try:
        own = _sha256(path)
        locations = _locations(path, own)
        for location in locations:
            _check_inside(path, location)
        weights = [path.parent / location for location in locations]
        for file in weights:
            if not file.is_file():
                raise InputError(f"{path} needs {file} beside it, which is not there; get both from the same place")
        digests = [own, *(_sha256(file) for file in weights)]
        size = sum(file.stat().st_size for file in (path, *weights))
    except OSError as error:
        raise InputError(f"{error.filename or path} cannot be read ({error.strerror})") from error
    if sha256 is not None and own != sha256.lower():
        raise InputError(f"{path} has the SHA-256 {own}, not {sha256.lower()}; it is another file or is damaged")
    digest = own if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()
    return ModelFile(path, digest, size)


@lru_cache(maxsize=16)
def _locations(path: Path, sha256: str) -> tuple[str, ...]:
    """`external_locations` of a file with this content, which is walked once."""
    return tuple(external_locations(path))


def external_locations(path: Path) -> list[str]:
    """The files that a model names for its weights, as they stand in it, each once, sorted.

    Raises:
        InputError: the file is no ONNX model.
        OSError: it cannot be read.
    """
    found: set[str] = set()
    graphs = 0
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            waiting = [("model", 0, len(data))]
            while waiting:
                record, start, end = waiting.pop()
                if record == "entry":
                    location = _location(data, start, end)
                    found.update([] if location is None else [location])
                    continue
                for number, first, last in _fields(data, start, end):
                    inner = _RECORDS[record].get(number)
                    if inner is not None:
                        graphs += record == "model" and inner == "graph"
                        waiting.append((inner, first, last))
    except ValueError as error:  # also an empty file, which cannot be mapped
        raise InputError(f"{path} is not an ONNX model; give the .onnx file of a network") from error
    if not graphs:
        raise InputError(f"{path} is not an ONNX model; give the .onnx file of a network")
    return sorted(found)


def _location(data: mmap.mmap, start: int, end: int) -> str | None:
    """The value of a key-value record whose key is "location"."""
    pair = {number: data[first:last] for number, first, last in _fields(data, start, end)}
    return pair.get(2, b"").decode("utf-8") if pair.get(1) == b"location" else None


def _fields(data: mmap.mmap, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """(field number, start, end) of the length-delimited fields of a record.

    Raises:
        ValueError: no protobuf.
    """
    at = start
    while at < end:
        tag, at = _varint(data, at, end)
        number, kind = tag >> 3, tag & 7
        if kind == _VARINT:
            _, at = _varint(data, at, end)
        elif kind == _BYTES:
            length, at = _varint(data, at, end)
            if at + length <= end:
                yield number, at, at + length
            at += length
        elif kind in (_FIXED64, _FIXED32):
            at += 8 if kind == _FIXED64 else 4
        else:
            raise ValueError("unknown wire type")
        if not number or at > end:
            raise ValueError("a field beyond its record")


def _varint(data: mmap.mmap, at: int, end: int) -> tuple[int, int]:
    """A variable-length number and the place after it."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= end:
            break
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("a number without an end")


def _check_inside(path: Path, location: str) -> None:
    """Refuse a location outside the model's folder, written for whatever system.

    Raises:
        InputError: it is outside.
    """
    posix, windows = PurePosixPath(location), PureWindowsPath(location)
    if not location or posix.is_absolute() or windows.drive or windows.root or ".." in windows.parts:
        raise InputError(
            f"{path} wants its weights from {location!r}, outside its own folder; get the model from its maker"
        )


def _sha256(path: Path) -> str:
    hasher = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            hasher.update(chunk)
    return hasher.hexdigest()
