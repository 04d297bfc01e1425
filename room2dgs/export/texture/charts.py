"""A mesh cut into charts that lie flat in a square picture (xatlas), and what each texel of it shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from room2dgs.mesh.coloring.drawn import drawn

PADDING_PX = 4  # between charts; twice that is seen by a viewer's first two smaller versions of the picture
BENT = 8.0  # cost at which a chart ends: 2, xatlas's own, cuts a rough surface into shreds


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
    """Cut and packed for a picture of this side."""
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
    """Those whose middles lie in a flat chart."""
    across = found.uv * (1, -1) + (0, 1)
    flat = np.column_stack([across, np.ones(len(across))]).astype(np.float32)
    K = np.diag([side_px, side_px, 1.0])
    face_at = drawn(flat, found.faces.astype(np.int32), K, (side_px, side_px)).face
    texel = np.argwhere(face_at >= 0)
    face = face_at[face_at >= 0].astype(np.int64)
    x, y = (texel[:, ::-1].T + 0.5) / side_px
    (ax, ay), (bx, by), (cx, cy) = (flat[found.faces[:, k], :2].T.astype(np.float64)[:, face] for k in range(3))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    second = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    third = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    return Texels(texel, face, np.column_stack([1 - second - third, second, third]))
