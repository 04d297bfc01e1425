"""The zero level of a table of voxels by open3d's marching cubes, some blocks at a time."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import open3d.core as o3c
import trimesh

from room2dgs.mesh.voxel_table import BLOCK, VOXELS, VoxelTable, block_coordinates, keys_of

# open3d takes 8 kB a block for its vertices, and a copy of what it meshes; some blocks at a time, those around them
# with them, take little more than the table.
TOGETHER = 8192
ATTRIBUTES = ("tsdf", "weight", "color")  # what open3d asks for
DEVICE = o3c.Device("CPU:0")


def extracted(table: VoxelTable, voxel_m: float, origin: np.ndarray, min_weight: float) -> trimesh.Trimesh:
    """The zero level, moved by `origin`, with colours; without vertices if there is none.

    Where blocks were meshed apart, vertices come twice, with the same bits: `clean` makes them one.

    Args:
        min_weight: views that must have seen a voxel for it to count.
    """
    firsts = np.arange(0, len(table.keys), TOGETHER)
    meshes = [_zero_level(table, some, voxel_m, min_weight) for some in np.split(table.keys, firsts[1:]) if len(some)]
    meshes = [mesh for mesh in meshes if len(mesh.faces)]
    if not meshes:
        return trimesh.Trimesh(process=False)
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return trimesh.Trimesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]) + origin,
        faces=np.concatenate([mesh.faces + first for mesh, first in zip(meshes, firsts[:-1], strict=True)]),
        vertex_colors=np.concatenate([mesh.visual.vertex_colors for mesh in meshes]),
        process=False,
    )


def _zero_level(table: VoxelTable, keys: np.ndarray, voxel_m: float, min_weight: float) -> trimesh.Trimesh:
    """Of some blocks, in the volume's frame. A face belongs to the block that its middle is in."""
    whole = len(keys) == len(table.keys)
    mesh = _volume(table, keys if whole else table.with_neighbours(keys), voxel_m, min_weight).extract_triangle_mesh(
        0.0
    )
    if "positions" not in mesh.vertex or len(mesh.vertex.positions) == 0 or "indices" not in mesh.triangle:
        return trimesh.Trimesh(process=False)
    vertices, faces = mesh.vertex.positions.numpy().astype(np.float64), mesh.triangle.indices.numpy()
    colors = np.round(np.clip(mesh.vertex.colors.numpy(), 0, 1) * 255).astype(np.uint8)
    if not whole:
        middle = vertices[faces].mean(axis=1)
        faces = faces[np.isin(keys_of(np.floor(middle / (BLOCK * voxel_m))), keys)]
        used, faces = np.unique(faces, return_inverse=True)
        vertices, faces, colors = vertices[used], faces.reshape(-1, 3), colors[used]
    return trimesh.Trimesh(vertices=vertices, faces=faces, vertex_colors=colors, process=False)


def _volume(table: VoxelTable, keys: np.ndarray, voxel_m: float, min_weight: float) -> o3d.t.geometry.VoxelBlockGrid:
    """Some blocks as open3d has them."""
    kinds, numbers = (o3c.float32,) * len(ATTRIBUTES), ((1,), (1,), (3,))
    volume = o3d.t.geometry.VoxelBlockGrid(ATTRIBUTES, kinds, numbers, voxel_m, BLOCK, len(keys), DEVICE)
    hashmap, blocks = volume.hashmap(), o3c.Tensor(block_coordinates(keys))
    hashmap.activate(blocks)
    rows = hashmap.find(blocks)[0].numpy()
    tsdf, weight, color = (volume.attribute(name).numpy() for name in ATTRIBUTES)  # not copies
    for part, which, at in table.in_parts(keys):
        tsdf.reshape(-1, VOXELS)[rows[which]] = part.tsdf[at]
        weight.reshape(-1, VOXELS)[rows[which]] = np.where(part.views[at] < min_weight, 0, part.weight[at])
        color.reshape(-1, 3 * VOXELS)[rows[which]] = part.color[at]
    return volume
