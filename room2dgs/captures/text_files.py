"""Small text files of captures: numbers in lines, keys with values, JSON; each number checked."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.errors import InputError
from room2dgs.regular_files import read_regular

MAX_TEXT_BYTES = 1 << 30  # of a text model of COLMAP, which is read line by line
MAX_TABLE_BYTES, MAX_LINES = 64 << 20, 1_000_000  # of poses and lists
MAX_LINE_LETTERS = 1 << 20
MAX_JSON_BYTES, MAX_JSON_VALUES = 64 << 20, 4_000_000  # 20,000 frames have 500,000 values


def text_of(path: Path, longest: int = MAX_TEXT_BYTES) -> str:
    """A text file's content; lines end in a newline alone.

    Args:
        longest: bytes that such a file may have.

    Raises:
        InputError: no regular file, empty, too large, unreadable or no text.
    """
    try:
        text = read_regular(path, longest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text in UTF-8; save it so, or replace the file") from error
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def lines_of(path: Path) -> list[tuple[int, str]]:
    """(number from 1, text) of the lines that are neither empty nor a comment (#).

    Raises:
        InputError: as `text_of`, or more lines than a capture has.
    """
    text = text_of(path, MAX_TABLE_BYTES)
    if text.count("\n") > MAX_LINES:
        raise InputError(
            f"{path} has more than {MAX_LINES:,} lines, too many for what it should hold; replace the file"
        )
    lines = enumerate(text.splitlines(), start=1)
    return [(number, line.strip()) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]


def floats(text: str, path: object, line: int | None = None, count: int | None = None) -> list[float]:
    """The numbers of a line, apart by white space or commas.

    Raises:
        InputError: something is no number, or there are not `count` of them.
    """
    where = f"{path} line {line}" if line else str(path)
    if len(text) > MAX_LINE_LETTERS:
        wanted = "" if count is None else f" where {count} numbers belong"
        raise InputError(f"{where} has {len(text):,} letters{wanted}; replace the file")
    try:
        found = [float(word) for word in text.replace(",", " ").split()]
    except ValueError as error:
        raise InputError(f"{where} holds something that is no number; replace the file") from error
    if count is not None and len(found) != count:
        raise InputError(f"{where} holds {len(found)} numbers where {count} belong; replace the file")
    return found


def key_values(path: Path) -> dict[str, str]:
    """Lines `key = value`."""
    pairs = (line.partition("=") for _, line in lines_of(path))
    return {key.strip(): value.strip() for key, equals, value in pairs if equals}


def number(known: Mapping[str, Any], key: str, path: object, default: float | None = None) -> float:
    """A finite number under a key.

    Raises:
        InputError: it is not there or none.
    """
    value = known.get(key, default)
    try:
        if isinstance(value, bool) or value is None:
            raise ValueError
        result = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path} has no number as {key}; add it") from error
    if not np.isfinite(result):
        raise InputError(f"{path} has {key}={result}, which is not finite; write the number again")
    return result


def positive(known: Mapping[str, Any], key: str, path: object, default: float | None = None) -> float:
    """A finite number above 0 under a key.

    Raises:
        InputError: it is not there, none, or not above 0.
    """
    result = number(known, key, path, default)
    if not result > 0:
        raise InputError(f"{path} has {key}={result:g}, which should be above 0; correct it")
    return result


def numbers(known: Mapping[str, Any], key: str, count: int, path: object) -> np.ndarray:
    """(count,) float64 under a key: a list, nested or not, or text; they may be infinite or NaN.

    Raises:
        InputError: there are not as many.
    """
    value = known.get(key)
    if isinstance(value, str):
        return np.array(floats(value, f"{path} ({key})", None, count))
    flat = list(_flat(value)) if value is not None else []
    if len(flat) != count or not all(_is_number(item) for item in flat):
        raise InputError(f"{path} has no {count} numbers as {key}; write them again")
    return np.array([float(item) for item in flat])


def intrinsic_matrix(known: Mapping[str, Any], key: str, path: object) -> np.ndarray:
    """(3, 3) K under a key, 9 numbers down the columns, as Eigen's matrices are written; or along the rows, which is
    told by where its zeros are.

    Raises:
        InputError: there are not as many numbers, or it is no camera's.
    """
    K = numbers(known, key, 9, path).reshape(3, 3).T
    if not K[2, :2].any():
        return K
    if K[:2, 2].any():
        raise InputError(f"{path} has {key}, which is no matrix of a camera (fx 0 cx, 0 fy cy, 0 0 1); correct it")
    return K.T


def _is_number(item: Any) -> bool:
    if isinstance(item, float):
        return True
    return isinstance(item, int) and not isinstance(item, bool) and abs(item) < 10**300


def _flat(value: Any, depth: int = 0) -> Iterable[Any]:
    if isinstance(value, list) and depth < 4:
        for item in value:
            yield from _flat(item, depth + 1)
    else:
        yield value


def read_json(path: Path, data: bytes | None = None) -> Any:
    """The content of a JSON file.

    Args:
        data: its bytes, where it is no file of its own.

    Raises:
        InputError: missing or no JSON.
    """
    text = text_of(path, MAX_JSON_BYTES) if data is None else data
    if len(text) > MAX_JSON_BYTES:
        raise InputError(f"{path} has {len(text) >> 20} MiB, too large for what it should hold; replace the file")
    if isinstance(text, str):
        marks = sum(text.count(mark) for mark in ("[", "{", ","))
    else:
        marks = sum(text.count(mark) for mark in (b"[", b"{", b","))
    if marks > MAX_JSON_VALUES:
        raise InputError(f"{path} holds more than {MAX_JSON_VALUES:,} values, too many for a capture; replace the file")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON ({str(error)[:80]}); write the file again") from error


def read_json_object(path: Path, data: bytes | None = None) -> dict[str, Any]:
    """The same for a file that holds an object.

    Raises:
        InputError: also if it holds something else.
    """
    found = read_json(path, data)
    if not isinstance(found, dict):
        raise InputError(f"{path} holds no JSON object; write the file again")
    return found


def quaternion_pose(x: float, y: float, z: float, w: float, t: Iterable[float], label: object) -> np.ndarray:
    """(4, 4) of a quaternion (any length) and a translation; what is not finite stays so.

    Raises:
        InputError: the quaternion is no rotation.
    """
    pose = np.eye(4)
    pose[:3, 3] = list(t)
    q = np.array([w, x, y, z], np.float64)
    if not np.isfinite(q).all():
        pose[:3, :3] = np.nan
        return pose
    length = np.linalg.norm(q)
    if not 0.5 < length < 2.0:
        raise InputError(f"{label} has a quaternion of length {length:.3g}, which is no rotation; write the pose again")
    w, x, y, z = q / length
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return pose
