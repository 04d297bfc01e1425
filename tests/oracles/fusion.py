"""Fusion in plain numpy and float64, over a box of voxels: the oracle of the compiled kernel."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from room2dgs.mesh.views import FusedView


def fused_voxels(
    views: Iterable[FusedView], voxels: np.ndarray, truncation_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weighted mean of truncated distances (Curless and Levoy 1996): from the plane through a pixel's point, or along
    the view's axis where its normal is not known or looks away.

    Args:
        voxels: (N, 3) metres, world frame.

    Returns:
        (N,) distance in units of the truncation distance, positive towards the cameras; 0 where nothing was seen.
        (N,) sum of weights. (N,) number of views.
    """
    total, weight, count = (np.zeros(len(voxels)) for _ in range(3))
    for view in views:
        in_pixels = (
            voxels @ view.camera.cam_from_world[:3, :3].T + view.camera.cam_from_world[:3, 3]
        ) @ view.camera.K.T
        near = np.where(in_pixels[:, 2] > 0, in_pixels[:, 2], np.nan)
        column, row = np.floor(in_pixels[:, :2] / near[:, None]).T
        inside = (column >= 0) & (row >= 0) & (column < view.camera.width) & (row < view.camera.height)
        pixel = np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)
        depth = np.asarray(view.depth, np.float64)[pixel]
        trust = np.ones(len(voxels)) if view.weight is None else np.asarray(view.weight, np.float64)[pixel]
        distance = (depth - near) / truncation_m
        hidden = distance < -1
        if view.normal is not None:
            normal, rays = np.asarray(view.normal, np.float64)[pixel], view.camera.world_rays()[pixel]
            with np.errstate(invalid="ignore"):  # endless depth on a ray with a zero
                points = view.camera.centre + depth[:, None] * rays
                ahead = ((voxels - points) * normal).sum(axis=1) / truncation_m
            distance = np.where((normal * rays).sum(axis=1) < 0, ahead, distance)
        taken = inside & (depth > 0) & (trust > 0) & (distance >= -1) & ~hidden
        total += np.where(taken, trust * np.minimum(distance, 1), 0)
        weight += np.where(taken, trust, 0)
        count += taken
    return np.divide(total, weight, out=total, where=weight > 0), weight, count
