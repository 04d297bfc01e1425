"""The ground-truth mesh: what the cameras saw of the room, in small triangles."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import trimesh

from room2dgs.demo_room.atlas import linear_to_srgb
from room2dgs.demo_room.geometry import EMITTER, Patch, triangulated
from room2dgs.demo_room.light import cast
from room2dgs.mesh.open3d import o3d

CHUNK = 2**14  # points at a time: they stay in the processor's cache
MAX_EDGE = 0.035  # metres, so that diagonals stay under 5 cm


class LitRoom(Protocol):
    """What the mesh needs of a room: its rays, its lights, its colours."""

    @property
    def scene(self) -> o3d.t.geometry.RaycastingScene: ...

    def radiance(self, patch: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """(N, 3) float32 linear radiance at parameters uv (N, 2) of patches (N,)."""


def visible_mesh(
    room: LitRoom, patches: list[Patch], K: np.ndarray, poses: np.ndarray, width: int, height: int
) -> trimesh.Trimesh:
    """Coloured triangles, of cells with edges up to `MAX_EDGE`, whose centroid a camera sees; lights are left out.

    Args:
        patches: the room's surfaces, in its order; cells with longer edges than `MAX_EDGE` must be planar.
        K: (3, 3) in pixels, pixel centres at +0.5.
        poses: (F, 4, 4) world_from_cam, metres.
    """
    fine = [patch.refined(MAX_EDGE) for patch in patches]
    soup = triangulated(fine)
    corners = soup.vertices.astype(np.float64)[soup.triangles]
    centroid = corners.mean(axis=1)
    light = np.array([patch.material.kind == EMITTER.kind for patch in patches])[soup.patch]
    seen = np.zeros(len(centroid), bool)
    for world_from_cam in poses:
        waiting = np.flatnonzero(~seen & ~light)
        seen[waiting[in_view(room, K, world_from_cam, width, height, centroid[waiting])]] = True

    faces = soup.triangles[seen].astype(np.int64)
    used, first = np.unique(faces.ravel(), return_index=True)
    color = room.radiance(soup.patch[seen][first // 3], soup.uv[seen].reshape(-1, 2)[first])
    new_id = np.zeros(len(soup.vertices), np.int64)
    new_id[used] = np.arange(len(used))
    return trimesh.Trimesh(
        vertices=soup.vertices[used],
        faces=new_id[faces],
        vertex_colors=np.round(255 * linear_to_srgb(color)).astype(np.uint8),
        process=False,
    )


def in_view(room: LitRoom, K, world_from_cam, width: int, height: int, points: np.ndarray) -> np.ndarray:
    """(N,) bool: points (N, 3) in the picture with nothing before them (tolerance: 2e-4 of the distance)."""
    seen = np.zeros(len(points), bool)
    for start in range(0, len(points), CHUNK):
        chunk = slice(start, start + CHUNK)
        ray = points[chunk] - world_from_cam[:3, 3]
        in_cam = ray @ world_from_cam[:3, :3]
        z = np.maximum(in_cam[:, 2], 1e-6)
        x, y = K[0, 0] * in_cam[:, 0] / z + K[0, 2], K[1, 1] * in_cam[:, 1] / z + K[1, 2]
        pictured = (in_cam[:, 2] > 1e-3) & (x > 0) & (x < width) & (y > 0) & (y < height)
        rows = np.flatnonzero(pictured)
        origins = np.broadcast_to(world_from_cam[:3, 3], (len(rows), 3))
        pictured[rows] = cast(room.scene, origins, ray[rows])["t_hit"] > 1 - 2e-4
        seen[chunk] = pictured
    return seen
