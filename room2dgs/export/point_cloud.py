"""A point cloud with normals, colours and confidence as PLY: one point a surfel, in the capture's own world."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from torch import Tensor

from room2dgs.captures.world_offset import AT_ORIGIN, Origin, too_far_for_float32, xyz_in_world
from room2dgs.export.local_files import write_file
from room2dgs.export.source import Source
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.primitives.primitive import Splats, mapped
from room2dgs.primitives.registry import primitive_of

RECORD = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
        ("confidence", "<f4"),
    ]
)
FAR_RECORD = np.dtype([(name, "<f8" if name in ("x", "y", "z") else RECORD[name]) for name in RECORD.names or ()])
TYPES = {"<f8": "double", "<f4": "float", "|u1": "uchar"}


def write_points(source: Source, path: Path) -> list[Path]:
    """In the capture's own world."""
    centres = np.stack([frame.camera.centre for frame in source.scene.frames])
    comments = source.comments(np.eye(3), local=False)
    return write_file(path, point_ply(source.surfels, centres, comments, source.origin_m))


def point_ply(splats: Splats, centres: np.ndarray, comments: Sequence[str] = (), origin_m: Origin = AT_ORIGIN) -> bytes:
    """A whole file, binary little endian; the confidence is the opacity.

    Args:
        centres: (V, 3) of the cameras, scene's frame; each normal points to the side of the nearest of them.
        origin_m: `Scene.origin_m`; the points lie in the capture's world, far from its origin in double.
    """
    splats, opacities = mapped(splats, Tensor.double), splats.opacities
    points = splats.centers.numpy()
    positions = xyz_in_world(points, origin_m)
    rows = np.zeros(len(points), FAR_RECORD if too_far_for_float32(positions) else RECORD)
    facing = facing_normals(points, primitive_of(splats).normals(splats).numpy(), centres)
    for name, values in zip(("x", "y", "z", "nx", "ny", "nz"), (*positions.T, *facing.T), strict=True):
        rows[name] = values
    colors = np.round((0.5 + C0 * splats.sh[:, 0].numpy()).clip(0, 1) * 255)
    for name, values in zip(("red", "green", "blue"), colors.T, strict=True):
        rows[name] = values
    rows["confidence"] = opacities.numpy()
    header = ["ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in comments)]
    header += [f"element vertex {len(rows)}"]
    header += [f"property {TYPES[rows.dtype[name].str]} {name}" for name in rows.dtype.names or ()]
    return "\n".join([*header, "end_header", ""]).encode("ascii", "replace") + rows.tobytes()


def facing_normals(points: np.ndarray, normal: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """(N, 3) normals turned to the nearest of the centres (V, 3); as they are without one."""
    from scipy.spatial import KDTree

    if not len(centres):
        return normal
    nearest = centres[KDTree(centres).query(points)[1]]
    away = np.einsum("ni,ni->n", normal, nearest - points) < 0
    return np.where(away[:, None], -normal, normal)
