"""Files of one piece, with what their coordinates count from where the format holds float32 or less.

Of a scene far from its world's origin such files hold coordinates about the scene; what is to be added to them stands
beside them, in NAME.offset.json.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from room2dgs.captures.world_offset import AT_ORIGIN
from room2dgs.export.source import Source
from room2dgs.files import whole_file

SUFFIX = ".offset.json"


def write_file(path: Path, data: bytes) -> list[Path]:
    """One whole file, or none."""
    with whole_file(path) as temporary:
        temporary.write_bytes(data)
    return [path]


def write_local(source: Source, path: Path, data: bytes, rotation: np.ndarray) -> list[Path]:
    """One file of coordinates in float32 or less, and what they count from beside it.

    Args:
        rotation: (3, 3) from the capture's world to the file's frame.
    """
    return [*write_file(path, data), *write_offset(source, path, rotation)]


def write_offset(source: Source, path: Path, rotation: np.ndarray) -> list[Path]:
    """NAME.offset.json beside a file or folder; nothing for a scene at its world's origin.

    Args:
        rotation: (3, 3) from the capture's world to the file's frame.
    """
    if source.origin_m == AT_ORIGIN:
        return []
    offset = source.offset_m(rotation).tolist()
    about = {
        "about": "metres; file coordinates + offset_m = file_from_world @ coordinates in the capture's world",
        "offset_m": offset,
        "file_from_world": rotation.tolist(),
        "origin_m": list(source.origin_m),
    }
    beside = path.with_name(path.name + SUFFIX)
    with whole_file(beside) as temporary:
        temporary.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    place = ", ".join(f"{value:.3f}" for value in offset)
    source.log(f"{path.name}: its format cannot hold coordinates this large, so add ({place}) m to them; {beside.name}")
    return [beside]
