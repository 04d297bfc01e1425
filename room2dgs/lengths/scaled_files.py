"""Files of a run at another scale: meshes, their binary glTF, the small maps of depth."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np

from room2dgs.captures.ply_elements import TYPES
from room2dgs.errors import InputError

END = b"end_header\n"
LENGTHS = ("x", "y", "z", "expected_error")  # of a vertex
ATTRIBUTES = ("POSITION", "_EXPECTED_ERROR")  # of a part of a glTF mesh
FLOAT = 5126


def scaled_ply(data: bytes, factor: float, name: str) -> bytes:
    """A binary PLY whose first element are vertices, as `write_mesh` writes it; all other bytes stay.

    Raises:
        InputError: it is another kind of file.
    """
    header, end, rest = data.partition(END)
    lines = [line.split() for line in header.decode("ascii", "replace").splitlines()]
    elements = [index for index, line in enumerate(lines) if line[:1] == ["element"]]
    plain = ["format", "binary_little_endian", "1.0"] in lines and elements and lines[elements[0]][1] == "vertex"
    if not end or not plain:
        raise InputError(f"{name} is no mesh as room2dgs writes it; mesh the run again")
    first, last = elements[0], elements[1] if len(elements) > 1 else len(lines)
    properties = [line for line in lines[first + 1 : last] if line[0] == "property"]
    if any(len(line) != 3 or line[1] not in TYPES for line in properties):
        raise InputError(f"{name} has vertices with lists; mesh the run again")
    dtype = np.dtype([(line[2], "<" + TYPES[line[1]]) for line in properties])
    count = int(lines[first][2])
    if len(rest) < count * dtype.itemsize:
        raise InputError(f"{name} is cut off; mesh the run again")
    rows = np.frombuffer(rest, dtype, count).copy()
    for key in LENGTHS:
        if key in (dtype.names or ()):
            rows[key] = rows[key] * factor
    return b"".join([header, END, rows.tobytes(), rest[count * dtype.itemsize :]])


def scaled_glb(data: bytes, factor: float, name: str) -> bytes:
    """A binary glTF with all its positions, and their bounds, scaled about the origin.

    Raises:
        InputError: it is none, or its positions are not plain floats.
    """
    try:
        length = struct.unpack("<I", data[12:16])[0]
        tree = json.loads(data[20 : 20 + length])
        head = 20 + length + 8  # of the second chunk
        content = bytearray(data[head:])
        for index in sorted(_lengths_in(tree)):
            _scale(tree, index, content, factor)
        for node in tree.get("nodes", []):
            if "translation" in node:
                node["translation"] = [factor * value for value in node["translation"]]
            if "matrix" in node:
                matrix = node["matrix"]
                node["matrix"] = [factor * value if 12 <= at < 15 else value for at, value in enumerate(matrix)]
    except (struct.error, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"{name} is no GLB as room2dgs writes it; mesh the run again") from error
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<I4s", len(content), b"BIN\0") + bytes(content)
    total = 12 + 8 + len(text) + len(chunk)
    return struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON") + text + chunk


def _lengths_in(tree: dict[str, Any]) -> set[int]:
    parts = (part for mesh in tree["meshes"] for part in mesh["primitives"])
    return {part["attributes"][name] for part in parts for name in ATTRIBUTES if name in part["attributes"]}


def _scale(tree: dict[str, Any], index: int, content: bytearray, factor: float) -> None:
    accessor = tree["accessors"][index]
    view = tree["bufferViews"][accessor["bufferView"]]
    width = {"VEC3": 3, "SCALAR": 1}[accessor["type"]]
    if accessor["componentType"] != FLOAT or view.get("byteStride", 4 * width) != 4 * width:
        raise ValueError
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    values = np.frombuffer(content, "<f4", accessor["count"] * width, start)
    scaled = (values.astype(np.float64) * factor).astype("<f4")
    content[start : start + scaled.nbytes] = scaled.tobytes()
    rows = scaled.reshape(-1, width)
    for key, bound in (("min", rows.min(axis=0)), ("max", rows.max(axis=0))):
        if key in accessor:
            accessor[key] = [float(value) for value in bound]


def scaled_trust(data: bytes, factor: float) -> bytes:
    """trust.npz with its depths scaled."""
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    for name, values in arrays.items():
        if name.endswith("/depth"):
            arrays[name] = np.minimum(values.astype(np.float32) * factor, 60_000).astype(np.float16)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()
