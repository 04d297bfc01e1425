"""What no camera saw: small holes closed, or a surface without any."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import KDTree

from room2dgs.geometry.arguments import number
from room2dgs.mesh.checks import check_mesh, check_surface
from room2dgs.mesh.open3d import o3c_tensor, o3d
from room2dgs.mesh.poisson import screened_poisson
from room2dgs.mesh.vertex_colors import vertex_colors

MARGIN = 2.0  # of the octree's side to the room's: what bulges out where nothing was seen is cut by its box


def holes_filled(mesh: trimesh.Trimesh, hole_m: float) -> trimesh.Trimesh:
    """Holes up to this size closed by triangles between their rims; everything else stays as it is.

    Args:
        hole_m: the largest hole, by the diagonal of the box around its rim (open3d judges nearly so).

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be; no such number.
    """
    check_mesh(mesh)
    number("hole_m", hole_m, least=0.0)
    whole = o3d.t.geometry.TriangleMesh(
        o3c_tensor(np.asarray(mesh.vertices).astype(np.float32)), o3c_tensor(np.asarray(mesh.faces).astype(np.int64))
    )
    filled = whole.fill_holes(hole_size=hole_m / 2)
    if "positions" not in filled.vertex or "indices" not in filled.triangle:  # open3d drops faces without an area
        return mesh.copy()
    # a copy: what open3d has filled is gone with `filled`, whatever still points to it
    return _colored(filled.vertex.positions.numpy(), filled.triangle.indices.numpy().copy(), mesh)


def watertight(mesh: trimesh.Trimesh, voxel_m: float) -> trimesh.Trimesh:
    """A closed surface by screened Poisson reconstruction of the mesh's vertices and normals.

    A room is seen from inside. For the reconstruction it is a solid whose normals point out of it: where nothing was
    seen, the surface then closes over the gap. It bulges there, and is pressed flat where it leaves the box around
    the mesh: a ceiling that is missing becomes a level one.

    Args:
        voxel_m: size of the detail to keep, as far as memory allows.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be, or of no size; no such number.
    """
    check_surface(mesh)
    number("voxel_m", voxel_m, above=0.0)
    points = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(mesh.vertices)))
    normals = -np.asarray(mesh.vertex_normals)
    points.normals = o3d.utility.Vector3dVector(normals)
    points = points.select_by_index(np.flatnonzero(np.linalg.norm(normals, axis=1) > 0.5).tolist())
    extent = float(np.ptp(np.asarray(mesh.vertices), axis=0).max())
    if not extent > 0 or not len(points.points):
        raise ValueError("the mesh has no size: all its faces are at one place or without an area")
    surface, _ = screened_poisson(points, extent, voxel_m, MARGIN)
    surface.triangles = o3d.utility.Vector3iVector(np.asarray(surface.triangles)[:, ::-1])
    surface = _largest(surface)
    low, high = np.asarray(mesh.vertices).min(axis=0), np.asarray(mesh.vertices).max(axis=0)
    surface.vertices = o3d.utility.Vector3dVector(np.asarray(surface.vertices).clip(low, high))
    return _colored(np.asarray(surface.vertices), np.asarray(surface.triangles), mesh)


def _largest(surface: o3d.geometry.TriangleMesh) -> o3d.geometry.TriangleMesh:
    """Its largest piece: Poisson leaves bubbles where there are no points."""
    piece, count, _ = surface.cluster_connected_triangles()
    surface.remove_triangles_by_mask(np.asarray(piece) != int(np.argmax(np.asarray(count))))
    return surface.remove_unreferenced_vertices()


def _colored(vertices: np.ndarray, faces: np.ndarray, source: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh with the colours of the source's nearest vertices."""
    vertices = vertices.astype(np.float64)
    colors = vertex_colors(source)
    if colors is not None:
        colors = colors[KDTree(np.asarray(source.vertices)).query(vertices)[1]]
    return trimesh.Trimesh(vertices, faces, vertex_colors=colors, process=False)
