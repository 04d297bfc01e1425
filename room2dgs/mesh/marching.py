"""The zero level of a table of voxels by open3d's marching cubes, some blocks at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from room2dgs.geometry.cells import cell_indices, keys_of
from room2dgs.mesh.open3d import o3c, o3c_tensor, o3d
from room2dgs.mesh.voxel_table import BLOCK, VOXELS, VoxelTable, block_coordinates

# open3d takes 8 kB a block for its vertices, and a copy of what it meshes: some blocks at a time, and those around them
# with them. Cubes of blocks have fewer around them than slabs.
TOGETHER = 2048
CUBE = 16  # blocks a side
ATTRIBUTES = ("tsdf", "weight", "color")  # what open3d asks for
DEVICE = o3c.Device("CPU:0")


class _Piece(NamedTuple):
    """Part of a surface in the volume's frame: (V, 3) float32, (V, 3) uint8, (F, 3) int32."""

    vertices: np.ndarray
    colors: np.ndarray
    faces: np.ndarray


def extracted(table: VoxelTable, voxel_m: float, origin: np.ndarray, min_weight: float) -> trimesh.Trimesh:
    """The zero level, moved by `origin`, with colours; without vertices if there is none.

    Where blocks were meshed apart, vertices come twice, with the same bits: `clean` makes them one.

    Args:
        table: has no blocks afterwards: a room's mesh and its voxels need not be there together.
        min_weight: views that must have seen a voxel for it to count.
    """
    pieces = [_zero_level(table, some, voxel_m, min_weight) for some in _together(table.keys)]
    pieces = [piece for piece in pieces if len(piece.faces)]
    table.clear()
    if not pieces:
        return trimesh.Trimesh(process=False)
    firsts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    return trimesh.Trimesh(
        vertices=np.concatenate([piece.vertices for piece in pieces], dtype=np.float64) + origin,
        faces=np.concatenate([piece.faces + first for piece, first in zip(pieces, firsts[:-1], strict=True)]),
        vertex_colors=np.concatenate([piece.colors for piece in pieces]),
        process=False,
    )


def _together(keys: np.ndarray) -> list[np.ndarray]:
    """Blocks that lie together, at most `TOGETHER` of them; few blocks stay as they are."""
    if len(keys) <= TOGETHER:
        return [keys] if len(keys) else []
    cubes = keys_of(block_coordinates(keys) // CUBE)
    keys = keys[np.argsort(cubes, kind="stable")]
    return np.split(keys, np.arange(TOGETHER, len(keys), TOGETHER))


def _zero_level(table: VoxelTable, keys: np.ndarray, voxel_m: float, min_weight: float) -> _Piece:
    """Of some blocks. A face belongs to the block that its middle is in."""
    whole = len(keys) == len(table.keys)
    mesh = _volume(table, keys if whole else table.with_neighbours(keys), voxel_m, min_weight).extract_triangle_mesh(
        0.0
    )
    if "positions" not in mesh.vertex or len(mesh.vertex.positions) == 0 or "indices" not in mesh.triangle:
        return _Piece(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8), np.zeros((0, 3), np.int32))
    vertices, faces = mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    colors = np.round(np.clip(mesh.vertex.colors.numpy(), 0, 1) * 255).astype(np.uint8)
    if not whole:
        middle = vertices.astype(np.float64)[faces].mean(axis=1)
        faces = faces[np.isin(keys_of(cell_indices(middle, BLOCK * voxel_m)), keys)]
        used, faces = np.unique(faces, return_inverse=True)
        vertices, faces, colors = vertices[used], faces.reshape(-1, 3), colors[used]
    return _Piece(vertices, colors, faces.astype(np.int32))


def _volume(table: VoxelTable, keys: np.ndarray, voxel_m: float, min_weight: float) -> o3d.t.geometry.VoxelBlockGrid:
    """Some blocks as open3d has them."""
    kinds, numbers = (o3c.float32,) * len(ATTRIBUTES), [o3c.SizeVector([count]) for count in (1, 1, 3)]
    volume = o3d.t.geometry.VoxelBlockGrid(ATTRIBUTES, kinds, numbers, voxel_m, BLOCK, len(keys), DEVICE)
    hashmap, blocks = volume.hashmap(), o3c_tensor(block_coordinates(keys))
    hashmap.activate(blocks)
    rows = hashmap.find(blocks)[0].numpy()
    tsdf, weight, color = (volume.attribute(name).numpy() for name in ATTRIBUTES)  # not copies
    for part, which, at in table.in_parts(keys):
        tsdf.reshape(-1, VOXELS)[rows[which]] = part.tsdf[at]
        weight.reshape(-1, VOXELS)[rows[which]] = np.where(part.views[at] < min_weight, 0, part.weight[at])
        color.reshape(-1, 3 * VOXELS)[rows[which]] = part.color[at]
    return volume
