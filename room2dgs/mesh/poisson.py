"""Screened Poisson reconstruction (Kazhdan and Hoppe 2013) by open3d, the same bits each time."""

from __future__ import annotations

import math

import numpy as np

from room2dgs.mesh.open3d import o3d

SHALLOWEST, DEEPEST = 5, 10  # of the octree: 32 to 1024 cells along its side


def screened_poisson(
    points: o3d.geometry.PointCloud, extent_m: float, voxel_m: float, margin: float
) -> tuple[o3d.geometry.TriangleMesh, np.ndarray]:
    """A surface through points with normals.

    open3d works in float32: points far from the origin lose digits.

    Args:
        points: with unit normals; their colours, if there are any, go to the surface.
        extent_m: longest side of what is reconstructed, > 0.
        voxel_m: side of the smallest cells, as far as memory allows.
        margin: the octree's side as a multiple of `extent_m`.

    Returns:
        The surface, whose faces wind counter-clockwise seen from where the normals point to, and for each of its V
        vertices the (V,) logarithm to base 2 of how many points are near.
    """
    depth = min(DEEPEST, max(SHALLOWEST, math.ceil(math.log2(extent_m * margin / voxel_m))))
    # one thread: with more, the order of sums and with it the vertices would differ from run to run
    surface, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        points, depth=depth, scale=margin, n_threads=1
    )
    return surface, np.asarray(density)
