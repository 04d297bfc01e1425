"""The mesh of a page: few enough triangles, and the colours that can be put on it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from room2dgs.eval.shading import CLAY
from room2dgs.mesh.io import read_mesh
from room2dgs.runs.page.packing import packed, stepped

FINE = 4  # times the wanted triangles: what is beyond is first joined on a grid, which takes no time
# photos that see a place, from so many on -> colour and words
SEEN = (
    (0, (0.75, 0.10, 0.10), "by no photo or one"),
    (2, (0.93, 0.55, 0.15), "by two"),
    (3, (0.97, 0.87, 0.35), "by three to five"),
    (6, (0.35, 0.70, 0.40), "by six and more"),
)


class Solid(NamedTuple):
    """A simplified mesh.

    Attributes:
        vertices: (N, 3) float64 metres.
        faces: (M, 3) int64.
        normals: (N, 3) unit, of the vertices.
        layers: what can be shown on it -> (N, 3) uint8.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    layers: dict[str, np.ndarray]


def solid(mesh: trimesh.Trimesh, faces: int) -> Solid:
    """The mesh with at most so many triangles, with the layers "color" and "shape"."""
    import open3d as o3d

    colors = np.tile(CLAY, (len(mesh.vertices), 1))
    if mesh.visual.kind == "vertex":
        colors = np.asarray(mesh.visual.vertex_colors)[:, :3] / 255
    made = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.asarray(mesh.vertices, np.float64)),
        o3d.utility.Vector3iVector(np.asarray(mesh.faces, np.int32)),
    )
    made.vertex_colors = o3d.utility.Vector3dVector(np.ascontiguousarray(colors))
    if len(mesh.faces) > FINE * faces:
        side = np.sqrt(mesh.area / (FINE * faces))
        made = made.simplify_vertex_clustering(max(side, 1e-6))
    if len(made.triangles) > faces:
        made = made.simplify_quadric_decimation(faces)
    made.remove_degenerate_triangles()
    made.remove_unreferenced_vertices()
    made.compute_vertex_normals()
    color = np.round(np.clip(np.asarray(made.vertex_colors), 0, 1) * 255).astype(np.uint8)
    grey = np.broadcast_to(np.round(CLAY * 255).astype(np.uint8), color.shape)
    layers = {"color": color, "shape": grey}
    triangles = np.asarray(made.triangles, np.int64)
    return Solid(np.asarray(made.vertices).copy(), triangles, np.asarray(made.vertex_normals).copy(), layers)


def with_error(one: Solid, error_file: Path) -> Solid:
    """With the layer "error", if the mesh was scored: colours of eval/error.ply, each vertex its nearest."""
    if not error_file.is_file():
        return one
    scored = read_mesh(error_file)
    nearest = cKDTree(np.asarray(scored.vertices)).query(one.vertices)[1]
    colors = np.asarray(scored.visual.vertex_colors)[nearest, :3].astype(np.uint8)
    return one._replace(layers={**one.layers, "error": colors})


def with_photos(one: Solid, photos: np.ndarray) -> Solid:
    """With the layer "seen": photos (N,) that see each vertex."""
    kind = np.searchsorted([start for start, _, _ in SEEN], photos, side="right") - 1
    ramp = np.round(np.array([color for _, color, _ in SEEN]) * 255).astype(np.uint8)
    return one._replace(layers={**one.layers, "seen": ramp[kind]})


def block(one: Solid) -> tuple[dict, str]:
    """What viewer.js wants to know of the mesh, and its bytes."""
    place, low, step = stepped(one.vertices)
    about = {
        "vertices": len(one.vertices),
        "faces": len(one.faces),
        "layers": list(one.layers),
        "low": low.tolist(),
        "step": step,
    }
    return about, packed(place, one.faces.astype(np.uint32), *one.layers.values())
