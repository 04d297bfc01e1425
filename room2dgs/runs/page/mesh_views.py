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

if TYPE_CHECKING:
    from room2dgs.splat.types import Rendering


def mesh_rendered(
    mesh: trimesh.Trimesh, frames: Iterable[Frame], background: tuple[float, float, float]
) -> Iterator[tuple[Frame, Rendering]]:
    """Each view of the mesh, as surfels would be rendered: its own colours, no light; nothing where no ray hits.

    Args:
        background: RGB, 0..1.
    """
    from room2dgs.splat.types import Rendering

    surface = Surface(mesh)
    colors = np.tile(np.asarray(CLAY, np.float64), (len(mesh.vertices), 1))
    if mesh.visual.kind == "vertex":
        colors = np.asarray(mesh.visual.vertex_colors)[:, :3] / 255
    for frame in frames:
        camera = frame.camera
        hits = surface.seen_by(camera)
        hit = hits.triangle >= 0
        color = np.tile(np.asarray(background, np.float64), (len(hit), 1))
        second, third = hits.uv[hit].T.astype(np.float64)
        weights = np.stack([1 - second - third, second, third], axis=1)
        color[hit] = np.einsum("nk,nkc->nc", weights, colors[surface.faces[hits.triangle[hit]]])
        normal = np.zeros_like(color)
        normal[hit] = surface.face_normals[hits.triangle[hit]]
        behind = np.einsum("nc,nc->n", normal, camera.world_rays().reshape(-1, 3)) > 0
        normal[behind] *= -1  # facing the camera
        maps = (color, hit, np.where(hit, hits.t, 0), normal)
        shape = (camera.height, camera.width)
        color, alpha, depth, normal = (
            torch.from_numpy(part.astype(np.float32).reshape(*shape, *part.shape[1:])) for part in maps
        )
        yield frame, Rendering(color, alpha, depth, depth, normal, torch.zeros(shape))
