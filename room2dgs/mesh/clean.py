"""A raw isosurface to a mesh that can be handed on."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from room2dgs.geometry.arguments import whole_number
from room2dgs.mesh.area import twice_areas
from room2dgs.mesh.checks import check_mesh
from room2dgs.mesh.vertex_colors import vertex_colors


def clean(mesh: trimesh.Trimesh, min_triangles: int = 0, keep_clusters: int | None = None) -> trimesh.Trimesh:
    """Merge, drop and order, so that equal surfaces give equal bytes.

    Dropped: faces with a non-finite vertex, faces that are degenerate or given twice, connected pieces of fewer
    than `min_triangles` faces, all but the `keep_clusters` largest pieces (None: all stay), unused vertices.
    Vertices at the same place become one. Vertices and faces come out sorted, whatever order they came in.

    Returns:
        A new mesh with colours kept and winding unchanged; possibly without faces.

    Raises:
        TypeError, ValueError: no mesh, or faces that name vertices which are not there; numbers that are none.
    """
    check_mesh(mesh, finite=False)
    whole_number("min_triangles", min_triangles)
    if keep_clusters is not None:
        whole_number("keep_clusters", keep_clusters)
    vertices, colors, faces = _sorted_vertices(mesh)
    faces = _sorted_faces(vertices, faces)
    faces = faces[_large_pieces(faces, len(vertices), min_triangles, keep_clusters)]
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    renumbered = np.cumsum(used) - 1
    return trimesh.Trimesh(
        vertices=vertices[used],
        faces=renumbered[faces],
        vertex_colors=None if colors is None else colors[used],
        process=False,
    )


def _sorted_vertices(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """Finite vertices in lexicographic order without repeats, their colours, and the faces renumbered."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64) + 0.0  # -0.0 becomes 0.0
    index = np.int32 if len(vertices) <= np.iinfo(np.int32).max else np.int64  # sorting takes several copies
    faces = np.asarray(mesh.faces).astype(index).reshape(-1, 3)
    colors = vertex_colors(mesh)
    finite = np.asarray(np.isfinite(vertices).all(axis=1))
    if not finite.all():
        faces = faces[finite[faces].all(axis=1)]
    if not len(faces):
        return vertices[:0], None, faces[:0]
    order = np.lexsort((vertices[:, 2], vertices[:, 1], vertices[:, 0], ~finite))
    order = order[: int(finite.sum())]
    ordered = vertices[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    renumbered = np.full(len(vertices), -1, dtype=index)
    renumbered[order] = np.cumsum(first) - 1
    if colors is not None:  # the maximum does not depend on the order of coinciding vertices
        colors = np.maximum.reduceat(colors[order], np.flatnonzero(first), axis=0)
    return ordered[first], colors, renumbered[faces]


def _sorted_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Faces with an area, each once, starting at its smallest vertex, in lexicographic order."""
    if not len(faces):
        return faces
    good = _with_an_area(vertices, faces)  # and so of three different vertices
    if not good.all():
        faces = faces[good]
    start = faces.argmin(axis=1).astype(np.uint8)
    a, b, c = (np.take_along_axis(faces, (start[:, None] + k) % 3, axis=1)[:, 0] for k in range(3))
    low, high = np.minimum(b, c), np.maximum(b, c)
    order = np.lexsort((b, high, low, a))  # both windings of a face are neighbours
    first = np.ones(len(order), dtype=bool)
    first[1:] = False
    for key in (a, low, high):
        in_order = key[order]
        first[1:] |= in_order[1:] != in_order[:-1]
    order = order[first]
    return np.stack([a[order], b[order], c[order]], axis=1)


def _with_an_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) bool."""
    found = np.empty(len(faces), dtype=bool)
    for part, areas in twice_areas(vertices, faces):
        found[part] = (areas != 0).any(axis=1)
    return found


def _large_pieces(faces: np.ndarray, vertices: int, min_triangles: int, keep_clusters: int | None) -> np.ndarray:
    """(F,) bool: faces of the pieces (connected by shared vertices) that stay."""
    if min_triangles <= 1 and keep_clusters is None:  # asked for by each stage, and a graph takes much
        return np.ones(len(faces), dtype=bool)
    if not len(faces):
        return np.zeros(0, dtype=bool)
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(ends), dtype=bool), (ends[:, 0], ends[:, 1])), shape=(vertices, vertices))
    _, labels = connected_components(graph, directed=False)
    piece = labels[faces[:, 0]]
    sizes = np.bincount(piece, minlength=labels.max() + 1)
    kept = sizes >= max(min_triangles, 1)
    if keep_clusters is not None:
        largest = np.argsort(-sizes, kind="stable")[:keep_clusters]
        kept &= np.isin(np.arange(len(sizes)), largest)
    return kept[piece]
