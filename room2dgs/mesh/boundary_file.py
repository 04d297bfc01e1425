"""boundary.ply: the open boundary of a mesh as edges, each with its kind and its kind's colour."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.captures.ply_elements import read_elements
from room2dgs.captures.world_offset import Origin, too_far_for_float32
from room2dgs.errors import InputError
from room2dgs.files import whole_file

MEND = "mesh the run again"


class BoundaryEdges(NamedTuple):
    """Edges of a boundary.

    Attributes:
        ends: (E, 2, 3) metres.
        kind: (E,) uint8.
    """

    ends: np.ndarray
    kind: np.ndarray


def write_boundary(path: Path, edges: BoundaryEdges, colors: np.ndarray, origin_m: Origin) -> None:
    """Binary PLY in the capture's own world, whole or not at all; vertices 2 e and 2 e + 1 are the ends of edge e.

    Args:
        edges: scene's frame.
        colors: (K, 3) uint8 of the kinds.
        origin_m: `Scene.origin_m`.
    """
    points = edges.ends.reshape(-1, 3) + np.array(origin_m)
    count, number = len(edges.kind), "double" if too_far_for_float32(points) else "float"
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {2 * count}",
            *(f"property {number} {axis}" for axis in "xyz"),
            f"element edge {count}",
            "property int vertex1",
            "property int vertex2",
            "property uchar kind",
            *(f"property uchar {name}" for name in ("red", "green", "blue")),
            "end_header\n",
        ]
    )
    rows = np.zeros(count, [("ends", "<i4", 2), ("kind", "u1"), ("color", "u1", 3)])
    rows["ends"] = np.arange(2 * count).reshape(-1, 2)
    rows["kind"], rows["color"] = edges.kind, colors[edges.kind]
    places = points.astype("<f8" if number == "double" else "<f4")
    with whole_file(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + places.tobytes() + rows.tobytes())


def read_boundary(path: Path, kinds: int, origin_m: Origin) -> BoundaryEdges:
    """In the scene's frame.

    Args:
        kinds: how many there are.

    Raises:
        InputError: missing, damaged, or no such file.
    """
    elements = read_elements(path, ("vertex", "edge"), MEND)
    try:
        vertex, edge = elements["vertex"].single, elements["edge"].single
        points = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float64)
        ends = np.stack([edge["vertex1"], edge["vertex2"]], axis=1).astype(np.int64)
        kind = edge["kind"].astype(np.int64)
    except KeyError as error:
        raise InputError(f"{path} is no boundary of a mesh; {MEND}") from error
    inside = (ends >= 0) & (ends < len(points))
    if not (inside.all() and np.isfinite(points).all() and ((kind >= 0) & (kind < kinds)).all()):
        raise InputError(f"{path} is damaged; {MEND}")
    return BoundaryEdges(points[ends] - np.array(origin_m), kind.astype(np.uint8))
