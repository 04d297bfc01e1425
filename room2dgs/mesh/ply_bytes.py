"""Binary PLY of a mesh: coordinates as float, and as double where float32 would round them visibly."""

from __future__ import annotations

import re

import numpy as np
import trimesh
from trimesh.exchange.ply import export_ply

from room2dgs.captures.world_offset import too_far_for_float32

END = b"end_header\n"
FLOATS = b"property float x\nproperty float y\nproperty float z\n"
SIZES = {b"char": 1, b"uchar": 1, b"short": 2, b"ushort": 2, b"int": 4, b"uint": 4, b"float": 4, b"double": 8}


def ply_bytes(mesh: trimesh.Trimesh, vertex_normal: bool | None = None) -> bytes:
    """A whole file, little endian, colours and vertex attributes with it.

    Coordinates are doubles where steps of float32 would be larger than 0.1 mm: a mesh in UTM coordinates.

    Args:
        vertex_normal: write normals; None: if the mesh has them at hand.
    """
    if not too_far_for_float32(mesh.vertices):
        return export_ply(mesh, vertex_normal=vertex_normal)
    data = export_ply(mesh, vertex_normal=vertex_normal)
    return _in_double(data, np.asarray(mesh.vertices, np.float64))


def _in_double(data: bytes, vertices: np.ndarray) -> bytes:
    """The same file with coordinates (N, 3) as doubles; they are the first of a vertex's properties."""
    header, _, rest = data.partition(END)
    properties = header.split(b"element vertex ")[1].split(b"element ")[0]
    stride = sum(SIZES[kind] for kind in re.findall(rb"^property (\w+) \w+$", properties, re.MULTILINE))
    size = len(vertices) * stride
    old = np.frombuffer(rest[:size], np.uint8).reshape(-1, stride)
    new = np.empty((len(vertices), stride + 12), np.uint8)
    new[:, :24] = np.ascontiguousarray(vertices, "<f8").view(np.uint8).reshape(-1, 24)
    new[:, 24:] = old[:, 12:]
    return b"".join([header.replace(FLOATS, FLOATS.replace(b"float", b"double"), 1), END, new.tobytes(), rest[size:]])
