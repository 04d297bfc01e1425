"""A triangle mesh to ask: how far, and what does this ray hit?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import open3d as o3d
import open3d.core as o3c
import trimesh

from room2dgs.geometry.camera import Camera
from room2dgs.mesh.checks import check_mesh

BATCH = 1_000_000  # rays or points at once: bounds the memory


class Hits(NamedTuple):
    """First hits of rays.

    Attributes:
        t: (N,) float32 ray parameter, inf where nothing is hit.
        triangle: (N,) int64 face index, -1 where nothing is hit.
        uv: (N, 2) float32 barycentric weights of the face's second and third corner.
    """

    t: np.ndarray
    triangle: np.ndarray
    uv: np.ndarray


class Surface:
    """Exact point-to-triangle distances and ray casts of one mesh.

    The tree works in float32, so it is built about the mesh's own middle.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        check_mesh(mesh)  # open3d reads past the end for faces that name vertices which are not there
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        self.faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
        self.middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2 if len(vertices) else np.zeros(3)
        corners = vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        self.face_normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
        self._scene = o3d.t.geometry.RaycastingScene()
        if len(self.faces):
            self._scene.add_triangles(
                o3c.Tensor.from_numpy((vertices - self.middle).astype(np.float32)),
                o3c.Tensor.from_numpy(self.faces.astype(np.uint32)),
            )

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) float64 in metres to the nearest point of any triangle, and that triangle (N,) int64.

        Without triangles: inf and -1.
        """
        distance = np.full(len(points), np.inf)
        triangle = np.full(len(points), -1, dtype=np.int64)
        if not len(self.faces):
            return distance, triangle
        for part in _batches(len(points)):
            local = (points[part] - self.middle).astype(np.float32)
            answer = self._scene.compute_closest_points(o3c.Tensor.from_numpy(local))
            distance[part] = np.linalg.norm((answer["points"].numpy() - local).astype(np.float64), axis=1)
            triangle[part] = answer["primitive_ids"].numpy()
        return distance, triangle

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """First hits of the rays origin + t direction, t > 0; (N, 3) each, or (3,) for one origin."""
        count = len(directions)
        hits = Hits(np.full(count, np.inf, np.float32), np.full(count, -1), np.zeros((count, 2), np.float32))
        if not len(self.faces):
            return hits
        origins = np.broadcast_to(origins, directions.shape)
        for part in _batches(count):
            rays = np.concatenate([origins[part] - self.middle, directions[part]], axis=1)
            answer = self._scene.cast_rays(o3c.Tensor.from_numpy(rays.astype(np.float32)))
            hits.t[part] = answer["t_hit"].numpy()
            hits.triangle[part] = np.where(
                np.isfinite(hits.t[part]), answer["primitive_ids"].numpy().astype(np.int64), -1
            )
            hits.uv[part] = answer["primitive_uvs"].numpy()
        return hits

    def seen_by(self, camera: Camera) -> Hits:
        """First hit of the ray through each pixel's centre, row by row; t is the z-depth in metres."""
        return self.cast(camera.centre, camera.world_rays().reshape(-1, 3))


def _batches(count: int) -> list[slice]:
    return [slice(start, start + BATCH) for start in range(0, count, BATCH)]
