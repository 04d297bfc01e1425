"""A mesh cut into charts that lie flat in a square picture (xatlas), and what each texel of it shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from room2dgs.mesh.open3d import o3c, o3d

PADDING_PX = 4  # between charts; twice that is seen by a viewer's first two smaller versions of the picture
BENT = 8.0  # cost at which a chart ends: 2, xatlas's own, cuts a rough surface into shreds
ABOVE = 1.0  # where rays that look for texels start


class Charts(NamedTuple):
    """The mesh, with a vertex repeated in every chart that it belongs to.

    Attributes:
        vertices: (V, 3) float64; source: (V,) its vertex in the mesh.
        faces: (F, 3) in the mesh's order and winding.
        uv: (V, 2) 0..1, u to the right, v up.
    """

    vertices: np.ndarray
    source: np.ndarray
    faces: np.ndarray
    uv: np.ndarray


class Texels(NamedTuple):
    """The picture's texels that show the surface, T of them.

    Attributes:
        texel: (T, 2) row and column.
        face: (T,) index.
        weights: (T, 3) of the face's corners; they sum to 1.
    """

    texel: np.ndarray
    face: np.ndarray
    weights: np.ndarray

    def of_vertices(self, faces: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(T, C) values of vertices (V, C), between the corners of each texel's face."""
        return np.einsum("tk,tkc->tc", self.weights, values[faces[self.face]])


def charts(mesh: trimesh.Trimesh, side_px: int) -> Charts:
    """Cut and packed for a picture of this side; needs xatlas."""
    import xatlas

    atlas = xatlas.Atlas()
    atlas.add_mesh(
        np.ascontiguousarray(mesh.vertices, np.float32),
        np.ascontiguousarray(mesh.faces, np.uint32),
        np.ascontiguousarray(mesh.vertex_normals, np.float32),
    )
    cut, pack = xatlas.ChartOptions(), xatlas.PackOptions()
    cut.max_cost, cut.max_iterations = BENT, 1
    pack.padding, pack.resolution, pack.bilinear = PADDING_PX, side_px, True
    atlas.generate(cut, pack)
    source, faces, uv = atlas[0]
    if atlas.atlas_count != 1:  # it did not fit: again, as large as it comes out in one
        pack.resolution, pack.texels_per_unit = 0, atlas.texels_per_unit / np.sqrt(atlas.atlas_count) * 0.9
        atlas.generate(cut, pack)
        source, faces, uv = atlas[0]
    return Charts(np.asarray(mesh.vertices)[source], source, faces.astype(np.int64), uv.astype(np.float64))


def texels(found: Charts, side_px: int) -> Texels:
    """By rays through the flat charts at the texels' middles."""
    flat = np.column_stack([found.uv, np.zeros(len(found.uv))]).astype(np.float32)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3c.Tensor(flat), o3c.Tensor(found.faces.astype(np.uint32)))  # type: ignore[call-overload]
    middle = (np.arange(side_px) + 0.5) / side_px
    u, v = np.meshgrid(middle, 1 - middle)
    rays = np.zeros((side_px, side_px, 6), np.float32)
    rays[..., 0], rays[..., 1], rays[..., 2], rays[..., 5] = u, v, ABOVE, -1
    answer = scene.cast_rays(o3c.Tensor(rays))  # type: ignore[call-overload]
    texel = np.argwhere(np.isfinite(answer["t_hit"].numpy()))
    rows, columns = texel.T
    second = answer["primitive_uvs"].numpy()[rows, columns].astype(np.float64)
    weights = np.column_stack([1 - second.sum(axis=1), second])
    return Texels(texel, answer["primitive_ids"].numpy()[rows, columns].astype(np.int64), weights)
