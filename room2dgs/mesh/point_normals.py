"""Normals of sparse points, on the side of the photos that see them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.geometry.arguments import check_points
from room2dgs.mesh.open3d import o3d

NEIGHBOURS = 30  # nearest points, itself among them, whose plane gives a point's normal; open3d's default


def towards_views(points: PointCloud, frames: Sequence[Frame], max_depth_m: float) -> np.ndarray:
    """Where each point is seen from: the sum of the unit vectors to the views that see it (`seen_points`).

    Args:
        max_depth_m: views that are farther away, in z-depth, do not count.

    Returns:
        (M, 3) float64, world frame; 0 for points that no view sees.
    """
    towards = np.zeros((len(points), 3))
    for frame in frames:
        seen = seen_points(points, frame)
        index = seen.index[seen.depth <= max_depth_m]
        rays = frame.camera.centre - points.xyz[index]
        towards[index] += rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return towards


def oriented_normals(xyz: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Normals by principal components of the nearest points (open3d).

    Args:
        xyz: (M, 3) metres.
        towards: (M, 3) any vectors on the side that each surface is seen from.

    Returns:
        (M, 3) float64 unit.

    Raises:
        TypeError, ValueError: no such points, or not as many of both.
    """
    if len(check_points("xyz", xyz)) != len(check_points("towards", towards)):
        raise ValueError(f"there are {len(xyz)} points and {len(towards)} sides that they are seen from")
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(xyz, np.float64)))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(knn=NEIGHBOURS))
    normals = np.asarray(cloud.normals)
    away = np.einsum("nc,nc->n", normals, towards) < 0
    return np.where(away[:, None], -normals, normals)
