"""What a GLB file announces, looked at before memory is taken for it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, BinaryIO

from room2dgs.errors import InputError

MOST_VALUES = 500_000_000  # of all meshes, each as often as it is placed
MAGIC, JSON_CHUNK = b"glTF", b"JSON"


def check_glb(path: Path, file: BinaryIO) -> None:
    """A file stays as it was opened: at its beginning.

    Raises:
        InputError: no GLB, values of no buffer, or one mesh placed so often that it would fill the memory.
    """
    try:
        head = file.read(20)
        length, kind = struct.unpack("<I4s", head[12:])
        if head[:4] != MAGIC or kind != JSON_CHUNK:
            raise _refused(path, "it is no GLB")
        tree = json.loads(file.read(length))
        accessors = [_count(path, one) for one in tree.get("accessors", [])]
        of_mesh = [
            sum(accessors[index] for part in mesh["primitives"] for index in _used(part)) for mesh in tree["meshes"]
        ]
        placed = sum(of_mesh[node["mesh"]] for node in tree.get("nodes", []) if "mesh" in node)
    except (struct.error, ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise _refused(path, "its description is damaged") from error
    finally:
        file.seek(0)
    if max(placed, sum(of_mesh)) > MOST_VALUES:
        raise _refused(path, f"it places {placed} vertices and faces")


def _count(path: Path, accessor: dict[str, Any]) -> int:
    count = accessor["count"]
    if not isinstance(count, int) or isinstance(count, bool) or count < 0:
        raise TypeError
    if "bufferView" not in accessor or "sparse" in accessor:
        raise _refused(path, "it has values that no buffer holds")
    return count


def _used(part: dict[str, Any]) -> list[int]:
    return [*part["attributes"].values(), *([part["indices"]] if "indices" in part else [])]


def _refused(path: Path, why: str) -> InputError:
    return InputError(f"{path} cannot be decoded as a mesh: {why}; write it again")
