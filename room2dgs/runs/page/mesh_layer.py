"""The mesh of a page: few enough triangles, and the colours that can be put on it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from room2dgs.captures.world_offset import Origin
from room2dgs.eval.alignment import transformed
from room2dgs.eval.shading import CLAY, error_color
from room2dgs.mesh.io import read_mesh
from room2dgs.mesh.simplify import decimated
from room2dgs.mesh.vertex_colors import vertex_colors
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, told_by
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.page.packing import packed, stepped

WORST = 0.95  # quantile of what is known, for vertices of which nothing is
FINE = 2  # times the wanted triangles: what is beyond is first joined on a grid, which takes no time
# number of photos that see a point, from so many on -> colour and text
SEEN = (
    (0, (0.75, 0.10, 0.10), "by no photo or one"),
    (2, (0.93, 0.55, 0.15), "by two"),
    (3, (0.97, 0.87, 0.35), "by three to five"),
    (6, (0.35, 0.70, 0.40), "by six and more"),
)


class PageMesh(NamedTuple):
    """A simplified mesh.

    Attributes:
        vertices: (N, 3) float64 metres.
        faces: (M, 3) int64.
        normals: (N, 3) unit, of the vertices.
        layers: what can be shown on it -> (N, 3) uint8.
        off_m: (N,) how far it is expected to be off, or else is off the photos' depth; None: neither is known.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    layers: dict[str, np.ndarray]
    off_m: np.ndarray | None = None


def page_mesh(mesh: trimesh.Trimesh, faces: int) -> PageMesh:
    """The mesh with at most about so many triangles, with the layers "color" and "shape"."""
    if len(mesh.faces) > FINE * faces:
        mesh = _joined(mesh, float(np.sqrt(mesh.area / (FINE * faces))))
    if len(mesh.faces) > faces:
        mesh = decimated(mesh, faces)
    colors = np.tile(np.round(CLAY * 255).astype(np.uint8), (len(mesh.vertices), 1))
    layers = {"color": colors, "shape": colors}
    own = vertex_colors(mesh)
    if own is not None:
        layers["color"] = own[:, :3].astype(np.uint8)
    normals = np.asarray(mesh.vertex_normals, np.float64)
    return PageMesh(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64), normals, layers)


def _joined(mesh: trimesh.Trimesh, side_m: float) -> trimesh.Trimesh:
    """Vertices in the same cell of a grid are one."""
    import open3d as o3d

    made = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.asarray(mesh.vertices, np.float64)),
        o3d.utility.Vector3iVector(np.asarray(mesh.faces, np.int32)),
    )
    own = vertex_colors(mesh)
    if own is not None:
        made.vertex_colors = o3d.utility.Vector3dVector(own[:, :3] / 255)
    made = made.simplify_vertex_clustering(max(side_m, 1e-6))
    made.remove_degenerate_triangles()
    made.remove_unreferenced_vertices()
    colors = np.round(np.asarray(made.vertex_colors) * 255).astype(np.uint8) if made.has_vertex_colors() else None
    return trimesh.Trimesh(np.asarray(made.vertices), np.asarray(made.triangles), vertex_colors=colors, process=False)


def with_error(one: PageMesh, out: Path, origin_m: Origin) -> PageMesh:
    """With the layer "error", if the run's mesh was scored: colours of eval/error.ply, each vertex its nearest."""
    error_file = out / "eval" / "error.ply"
    # meshing anew takes the scores out of metrics.json; the picture of the earlier mesh's error stays on the disk
    if not error_file.is_file() or read_metrics(out).get("protocol") is None:
        return one
    scored, align = read_mesh(error_file), read_metrics(out).get("align")
    scored_colors = vertex_colors(scored)
    if scored_colors is None:  # somebody else's file
        return one
    # a mesh that was aligned is scored, and coloured, in the truth's frame
    vertices = one.vertices + origin_m
    vertices = transformed(vertices, np.array(align["truth_from_pred"])) if isinstance(align, dict) else vertices
    nearest = cKDTree(np.asarray(scored.vertices)).query(vertices)[1]
    colors = scored_colors[nearest, :3].astype(np.uint8)
    return one._replace(layers={**one.layers, "error": colors})


def with_expected(one: PageMesh, mesh: trimesh.Trimesh, full_m: float) -> PageMesh:
    """With the layer "expected", and lengths' ± by it, if the mesh says how far off it is expected to be.

    Args:
        mesh: the run's whole one, in the same frame; each vertex is as far off as the nearest of it.
        full_m: from which on the colour stays, as in the layer "error".
    """
    expected = told_by(mesh, EXPECTED_ERROR)
    if expected is None:
        return one
    nearest = cKDTree(np.asarray(mesh.vertices)).query(one.vertices)[1]
    colors = np.round(error_color(expected[nearest], full_m) * 255).astype(np.uint8)
    return one._replace(layers={**one.layers, "expected": colors}, off_m=expected[nearest].astype(np.float64))


def with_photos(one: PageMesh, photos: np.ndarray) -> PageMesh:
    """With the layer "seen": photos (N,) that see each vertex."""
    kind = np.searchsorted([start for start, _, _ in SEEN], photos, side="right") - 1
    ramp = np.round(np.array([color for _, color, _ in SEEN]) * 255).astype(np.uint8)
    return one._replace(layers={**one.layers, "seen": ramp[kind]})


def with_off(one: PageMesh, off_m: np.ndarray) -> PageMesh:
    """With how far each vertex (N,) is off the photos' depth; where no depth is known, as at most others' worst."""
    known = off_m[np.isfinite(off_m)]
    return one._replace(off_m=np.nan_to_num(off_m, nan=float(np.quantile(known, WORST)))) if len(known) else one


def block(one: PageMesh) -> tuple[dict, str]:
    """What room.js wants to know of the mesh, and its bytes."""
    positions, low, step = stepped(one.vertices)
    about = {
        "vertices": len(one.vertices),
        "faces": len(one.faces),
        "layers": list(one.layers),
        "low": low.tolist(),
        "step": step,
        "spread": one.off_m is not None,
    }
    off = [] if one.off_m is None else [np.clip(np.ceil(one.off_m * 1000), 1, 255).astype(np.uint8)]
    return about, packed(positions, one.faces.astype(np.uint32), *one.layers.values(), *off)
