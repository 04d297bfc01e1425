"""Fewer faces, with the distance to the whole mesh measured; quadric decimation.

fast-simplification (MIT) is ten times faster than open3d, but cares less for rims: where a number of faces is wanted it
takes a mesh of millions down to `LARGE`, and open3d goes on; under a bound of the error open3d works alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import fast_simplification
import numpy as np
import trimesh
from scipy.spatial import KDTree

from room2dgs.geometry.arguments import check_points, number, whole_number
from room2dgs.mesh.checks import check_mesh, check_surface
from room2dgs.mesh.open3d import o3c_tensor, o3d
from room2dgs.mesh.vertex_colors import vertex_colors

FEWEST = 100  # faces
STEP = 0.5  # of the faces stay, from one try to the next
REFINEMENTS = 2  # halvings of the last step
BOUNDARY_WEIGHT = 3.0  # a room's mesh has holes, whose rims should stay where they are
LARGE = 250_000  # faces
AGGRESSION = 5.0  # of fast-simplification: with less it may end before
NEAR = 7  # vertices of the whole mesh that colour one of the other
MOST = 0.999  # of both surfaces, that lie within the error
SAMPLES = 400_000  # of the whole mesh's vertices, at most


@dataclass(frozen=True)
class Simplified:
    """A mesh with fewer faces.

    Attributes:
        mesh: colours kept.
        largest_m, most_m, mean_m: distance between the two surfaces, metres, the larger of both directions: from the
            whole mesh's vertices, and from the vertices and middles of the faces that are left. 99.9 % lie within
            `most_m`.
    """

    mesh: trimesh.Trimesh
    largest_m: float
    most_m: float
    mean_m: float

    @property
    def sentence(self) -> str:
        return (
            f"off by {self.mean_m * 1000:.1f} mm on average, by less than {self.most_m * 1000:.1f} mm in 99.9 %, "
            f"{self.largest_m * 1000:.0f} mm at most"
        )


def simplified(mesh: trimesh.Trimesh, faces: int | None = None, max_error_m: float | None = None) -> Simplified:
    """As few faces as wanted, or as the largest error allows.

    Args:
        faces: this many are wanted; None: as few as `max_error_m` allows.
        max_error_m: of 99.9 % of both surfaces, as measured; None: any. With both, `faces` or more. The rest are shreds
            at the rims of a rough mesh, for whose sake nothing could be simplified.

    Returns:
        The mesh as it is, if it has no more faces than wanted or every step would exceed the error.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be; no such numbers.
    """
    check_mesh(mesh)
    if faces is not None:
        faces = whole_number("faces", faces)
    if max_error_m is not None:
        number("max_error_m", max_error_m, least=0.0)
    best = Simplified(mesh, 0.0, 0.0, 0.0)
    fewest = max(faces or FEWEST, FEWEST)
    if len(mesh.faces) <= fewest:
        return best
    if max_error_m is None:
        return measured(mesh, decimated(mesh, fewest))
    whole = Measure(mesh)
    refused = 0  # a number of faces with which the error was too large
    while len(best.mesh.faces) > fewest and not refused:
        target = max(fewest, int(len(best.mesh.faces) * STEP))
        best, refused = _tried(whole, best, target, max_error_m)
        if refused:
            for _ in range(REFINEMENTS):
                target = int(np.sqrt(float(refused) * len(best.mesh.faces)))
                best, worse = _tried(whole, best, target, max_error_m)
                refused = worse or refused
    return best


def decimated(mesh: trimesh.Trimesh, faces: int, careful: bool = False) -> trimesh.Trimesh:
    """The mesh with about so many faces; each vertex has the colour of those that were around it.

    Args:
        careful: by open3d alone.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be; no such number.
    """
    check_mesh(mesh)
    faces = whole_number("faces", faces, 1)
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if not careful:
        vertices, triangles = _sooner(vertices, triangles, max(faces, LARGE))
    less = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(triangles))
    if len(triangles) > faces:
        less = less.simplify_quadric_decimation(faces, boundary_weight=BOUNDARY_WEIGHT)
    less = less.remove_degenerate_triangles().remove_duplicated_triangles().remove_unreferenced_vertices()
    vertices = np.asarray(less.vertices)
    colors = colors_at(mesh, vertices) if vertex_colors(mesh) is not None and len(vertices) else None
    return trimesh.Trimesh(vertices, np.asarray(less.triangles), vertex_colors=colors, process=False)


def _sooner(vertices: np.ndarray, triangles: np.ndarray, faces: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces, about so many of them or the fewer that there are."""
    if len(triangles) <= faces:
        return vertices, triangles
    middle = vertices.mean(axis=0)  # it works in float32
    vertices, triangles = fast_simplification.simplify(
        (vertices - middle).astype(np.float32), triangles.astype(np.int32), target_count=faces, agg=AGGRESSION
    )
    return vertices.astype(np.float64) + middle, triangles


def measured(whole: trimesh.Trimesh, less: trimesh.Trimesh) -> Simplified:
    """How far two meshes are from each other.

    Raises:
        TypeError, ValueError: the first has no faces, or one of them cannot be.
    """
    return Measure(whole)(less)


def colors_at(mesh: trimesh.Trimesh, vertices: np.ndarray) -> np.ndarray:
    """(V, 3) uint8: a vertex's own colour if it is one of the mesh's, the median of the nearest
    otherwise, which mixes nothing across an edge.

    Decimation heeds shape alone: on a flat wall its own colours would come from anywhere.

    Raises:
        TypeError, ValueError: no mesh with vertices and their colours; no (V, 3) finite numbers.
    """
    check_mesh(mesh)
    vertices = check_points("vertices", vertices)
    all_colors = vertex_colors(mesh)
    if all_colors is None or not len(mesh.vertices):
        raise ValueError("the mesh has no colours of vertices")
    count = min(NEAR, len(mesh.vertices))
    distances, near = KDTree(np.asarray(mesh.vertices)).query(vertices, k=list(range(1, count + 1)))
    colors = all_colors[near, :3]
    own = (distances[:, 0] == 0)[:, None]
    return np.where(own, colors[:, 0], np.round(np.median(colors, axis=1))).astype(np.uint8)


class Measure:
    """Distances from one mesh, whose tree is built once."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        check_surface(mesh)
        vertices = np.asarray(mesh.vertices)
        self.middle = vertices.mean(axis=0)
        self.points = vertices[:: max(1, len(vertices) // SAMPLES)]
        self.tree = self._tree(mesh)

    def __call__(self, less: trimesh.Trimesh) -> Simplified:
        check_mesh(less)
        if not len(less.faces):
            return Simplified(less, np.inf, np.inf, np.inf)
        there = self._distances(self._tree(less), self.points)
        middles = np.asarray(less.vertices)[np.asarray(less.faces)].mean(axis=1)
        back = self._distances(self.tree, np.concatenate([np.asarray(less.vertices), middles]))
        figures = (np.max, partial(np.quantile, q=MOST), np.mean)
        return Simplified(less, *(float(max(figure(there), figure(back))) for figure in figures))

    def _tree(self, mesh: trimesh.Trimesh) -> o3d.t.geometry.RaycastingScene:
        """In float32, about the middle of the whole mesh."""
        tree = o3d.t.geometry.RaycastingScene()
        vertices = (np.asarray(mesh.vertices) - self.middle).astype(np.float32)
        tree.add_triangles(o3c_tensor(vertices), o3c_tensor(np.asarray(mesh.faces).astype(np.uint32)))
        return tree

    def _distances(self, tree: o3d.t.geometry.RaycastingScene, points: np.ndarray) -> np.ndarray:
        return tree.compute_distance(o3c_tensor((points - self.middle).astype(np.float32))).numpy()


def _tried(whole: Measure, best: Simplified, target: int, max_error_m: float) -> tuple[Simplified, int]:
    """The better of what was and what is tried, and the number of faces that was too small (0: none was)."""
    found = whole(decimated(best.mesh, target, careful=True))
    if found.most_m > max_error_m:
        return best, target
    # what cannot be decimated further ends the search
    return found, 0 if len(found.mesh.faces) < len(best.mesh.faces) else target
