"""What a camera sees of a mesh: depth, and which face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from room2dgs import _C
from room2dgs.geometry.camera import NEAR_M, Camera


class Drawn(NamedTuple):
    """What is nearest in each pixel.

    Attributes:
        depth: (H, W) float32 z-depth of the nearest face at the pixel's centre, metres; 0 where there is none.
        face: (H, W) int32 its index; -1 where there is none.
    """

    depth: np.ndarray
    face: np.ndarray


class Surface:
    """A mesh as it is drawn many times.

    Args:
        mesh: near the origin of its frame, metres; both sides of its faces are seen.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.vertices = np.asarray(mesh.vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)

    def seen_by(self, camera: Camera) -> Drawn:
        """Depth and faces; the same bits on any number of threads."""
        # no matrix product: the last bits of a BLAS depend on its threads
        rotation, shift = camera.rotation, camera.cam_from_world[:3, 3]
        x, y, z = self.vertices.T
        in_cam = np.empty((len(x), 3), np.float32)
        for axis, row in enumerate(rotation):
            in_cam[:, axis] = row[0] * x + row[1] * y + row[2] * z + shift[axis]
        return drawn(in_cam, self.faces, camera.K, camera.size)


def drawn(in_cam: np.ndarray, faces: np.ndarray, K: np.ndarray, size: tuple[int, int]) -> Drawn:
    """Faces of a camera's frame, by the rays through the pixels' centres.

    Args:
        in_cam: (V, 3) float32 vertices, camera frame.
        faces: (F, 3) int32.
        K: (3, 3) pixels.
        size: (width, height).
    """
    width, height = size
    depth, face = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
    _C.draw_faces(in_cam, faces, K[0, 0], K[1, 1], K[0, 2], K[1, 2], NEAR_M, depth, face)
    return Drawn(depth, face)
