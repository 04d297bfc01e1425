"""A point cloud with normals, colours and confidence as PLY: one point a surfel, in the capture's own world."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.rotations import normals
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.splat.types import Surfels

RECORD = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
        ("confidence", "<f4"),
    ]
)
TYPES = {"<f4": "float", "|u1": "uchar"}


def point_ply(surfels: Surfels, centres: np.ndarray, comments: Sequence[str] = ()) -> bytes:
    """A whole file, binary little endian; the confidence is the opacity.

    Args:
        centres: (V, 3) of the cameras, world; each normal points to the side of the nearest of them.
    """
    points = surfels.centers.double().numpy()
    rows = np.zeros(len(points), RECORD)
    facing = facing_normals(points, normals(surfels.rotations.double()).numpy(), centres)
    for name, values in zip(("x", "y", "z", "nx", "ny", "nz"), (*points.T, *facing.T), strict=True):
        rows[name] = values
    colors = np.round((0.5 + C0 * surfels.sh[:, 0].double().numpy()).clip(0, 1) * 255)
    for name, values in zip(("red", "green", "blue"), colors.T, strict=True):
        rows[name] = values
    rows["confidence"] = surfels.opacities.numpy()
    header = ["ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in comments)]
    header += [f"element vertex {len(rows)}"]
    header += [f"property {TYPES[RECORD[name].str]} {name}" for name in RECORD.names or ()]
    return "\n".join([*header, "end_header", ""]).encode("ascii", "replace") + rows.tobytes()


def facing_normals(points: np.ndarray, normal: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """(N, 3) normals turned to the nearest of the centres (V, 3); as they are without one."""
    from scipy.spatial import KDTree

    if not len(centres):
        return normal
    nearest = centres[KDTree(centres).query(points)[1]]
    away = np.einsum("ni,ni->n", normal, nearest - points) < 0
    return np.where(away[:, None], -normal, normal)
