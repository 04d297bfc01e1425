"""What photos' cameras see of a mesh: the renderings of a run that trained nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import torch
import trimesh

from room2dgs.captures.scene import Frame
from room2dgs.eval.shading import CLAY
from room2dgs.eval.surface import Surface
from room2dgs.mesh.vertex_colors import vertex_colors

if TYPE_CHECKING:
    from room2dgs.geometry.camera import Camera
    from room2dgs.splat.types import Rendering


class DrawnMesh:
    """A mesh that cameras look at: its own colours, no light."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self._surface = Surface(mesh)
        self._colors = np.tile(np.asarray(CLAY, np.float64), (len(mesh.vertices), 1))
        own = vertex_colors(mesh)
        if own is not None:
            self._colors = own[:, :3] / 255

    def rendering(self, camera: Camera, background: tuple[float, float, float]) -> Rendering:
        """As surfels would be rendered; nothing where no ray hits.

        Args:
            background: RGB, 0..1.
        """
        from room2dgs.splat.types import Rendering

        hits = self._surface.seen_by(camera)
        hit = hits.triangle >= 0
        color = np.tile(np.asarray(background, np.float64), (len(hit), 1))
        second, third = hits.uv[hit].T.astype(np.float64)
        weights = np.stack([1 - second - third, second, third], axis=1)
        color[hit] = np.einsum("nk,nkc->nc", weights, self._colors[self._surface.faces[hits.triangle[hit]]])
        normal = np.zeros_like(color)
        normal[hit] = self._surface.face_normals[hits.triangle[hit]]
        behind = np.einsum("nc,nc->n", normal, camera.world_rays().reshape(-1, 3)) > 0
        normal[behind] *= -1  # facing the camera
        maps = (color, hit, np.where(hit, hits.t, 0), normal)
        shape = (camera.height, camera.width)
        drawn, alpha, depth, facing = (
            torch.from_numpy(part.astype(np.float32).reshape(*shape, *part.shape[1:])) for part in maps
        )
        return Rendering(drawn, alpha, depth, depth, facing, torch.zeros(shape))


def mesh_rendered(
    mesh: trimesh.Trimesh, frames: Iterable[Frame], background: tuple[float, float, float]
) -> Iterator[tuple[Frame, Rendering]]:
    """Each view of the mesh (`DrawnMesh.rendering`)."""
    drawn = DrawnMesh(mesh)
    for frame in frames:
        yield frame, drawn.rendering(frame.camera, background)
