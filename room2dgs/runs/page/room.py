"""What a page's first screen says of the room: how large it is, and its mesh with the photos on it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from room2dgs.runs.page.texts import part
from room2dgs.runs.schema import is_number

GLB_HEAD, GLB_JSON = b"glTF", b"JSON"
MAX_GLB_MB = 12.0  # a larger one is left out of the page, which shows the colours of vertices then
AGREE_M = 0.2  # between the GLB's box and the mesh's: else it is another mesh's


class RoomFacts(NamedTuple):
    """What the rest of the house knows of a run's room, for its page.

    Attributes:
        plan: the floor plan as SVG; None: none was found.
        size_m: (2,) the largest room's sides, the longer first; None without a plan.
        area_m2: of all rooms' floors.
        height_m: from floor to ceiling; None: not seen.
        level_from_world: (3, 3) rotation of the plan's frame: x and y across the floor as on the plan, z up.
        glb: the textured mesh, a GLB file.
        scene_from_glb: (3, 3) rotation from the file's frame.
    """

    plan: str | None = None
    size_m: tuple[float, float] | None = None
    area_m2: float | None = None
    height_m: float | None = None
    level_from_world: np.ndarray | None = None
    glb: bytes | None = None
    scene_from_glb: np.ndarray | None = None


def first_facts(room: RoomFacts, metrics: dict[str, Any], unit: str, box_m: np.ndarray | None) -> list[dict[str, str]]:
    """Size, area, height, and how complete the mesh is.

    Args:
        unit: of lengths.
        box_m: (3,) sides of a box around the mesh, which stands in where there is no plan; None: no mesh.
    """
    found = []
    if room.size_m is not None and room.area_m2 is not None:
        longer, shorter = room.size_m
        found.append((f"{longer:.2f} × {shorter:.2f} {unit}", "size"))
        found.append((f"{room.area_m2:.1f} {unit}²", "floor"))
    elif box_m is not None:
        found.append((f"{' × '.join(f'{side:.1f}' for side in box_m)} {unit}", "box around the mesh"))
    if room.height_m is not None:
        found.append((f"{room.height_m:.2f} {unit}", "height"))
    coverage = completeness(metrics)
    if coverage is not None:
        found.append((f"{coverage:.0%}", "complete: share of the photos' pixels with surface"))
    return [{"value": value, "what": what} for value, what in found]


def completeness(metrics: dict[str, Any]) -> float | None:
    """Share of the photos' pixels that the mesh covers; None: not measured."""
    measured = part(part(metrics, "verdict"), "measures").get("coverage")
    known = (part(metrics, "mesh_quality").get("coverage"), measured)
    return next((float(value) for value in known if value is not None and is_number(value)), None)


def read_glb(path: Path) -> bytes | None:
    """The file, if it is there, a GLB with a picture inside, and not too large for a page."""
    if not path.is_file() or path.stat().st_size > 1e6 * MAX_GLB_MB:
        return None
    data = path.read_bytes()
    return data if glb_box(data) is not None else None


def glb_box(data: bytes) -> np.ndarray | None:
    """(2, 3) smallest and largest coordinates of the only mesh of a GLB; None: it is none that room.js reads."""
    try:
        magic, _, _, length, kind = struct.unpack("<4sII I4s", data[:20])
        if (magic, kind) != (GLB_HEAD, GLB_JSON):
            return None
        tree = json.loads(data[20 : 20 + length])
        (mesh,) = tree["meshes"]
        (primitive,) = mesh["primitives"]
        tree["bufferViews"][tree["images"][0]["bufferView"]], primitive["attributes"]["TEXCOORD_0"]
        place = tree["accessors"][primitive["attributes"]["POSITION"]]
        return np.array([place["min"], place["max"]], float).reshape(2, 3)
    except (struct.error, ValueError, KeyError, IndexError, TypeError):
        return None


def belongs(data: bytes, scene_from_glb: np.ndarray, vertices: np.ndarray) -> bool:
    """Whether a GLB is of the mesh with these vertices (N, 3): the boxes around both are the same."""
    box = glb_box(data)
    if box is None:
        return False
    turned = vertices @ scene_from_glb  # its transpose turns vertices of the scene into the file's frame
    return bool(np.abs(np.array([turned.min(axis=0), turned.max(axis=0)]) - box).max() < AGREE_M)
