"""Triangulated points of tracks for given cameras, and their reprojection errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.captures.point_cloud import Tracks
from room2dgs.geometry.camera import NEAR_M, Camera

STEPS = 8
ROBUST_PX = 1.0


def triangulated(cameras: Sequence[Camera], tracks: Tracks) -> np.ndarray:
    """Points with least reprojection errors under Cauchy's loss, by Gauss-Newton from the midpoint of the rays.

    Args:
        tracks: observations sorted by point; every point has one at least.

    Returns:
        (M, 3) float64 metres, world frame; NaN where rays are parallel or the point lies behind a camera.
    """
    if not len(tracks):
        return np.zeros((0, 3))
    start = np.flatnonzero(np.diff(tracks.point, prepend=-1))
    view = _Views(cameras, tracks)
    direction = np.einsum("oji,oj->oi", view.rotation, view.ray)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.eye(3) - direction[:, :, None] * direction[:, None]
    normal = np.add.reduceat(across, start)
    centre = -np.einsum("oji,oj->oi", view.rotation, view.translation)
    xyz = _solved(normal, np.add.reduceat(np.einsum("oij,oj->oi", across, centre), start))
    scale = ROBUST_PX
    for step in range(STEPS):
        off, jacobian, _ = view.residuals(xyz)
        error = np.linalg.norm(off, axis=1)
        if step == 0:  # far from the solution every error is large
            scale = max(ROBUST_PX, float(np.nanmedian(error))) if np.isfinite(error).any() else ROBUST_PX
        elif step == STEPS // 2:
            scale = ROBUST_PX
        weight = 1 / (1 + (error / scale) ** 2)
        normal = np.add.reduceat(np.einsum("o,oki,okj->oij", weight, jacobian, jacobian), start)
        gradient = np.add.reduceat(np.einsum("o,oki,ok->oi", weight, jacobian, off), start)
        trace = np.trace(normal, axis1=1, axis2=2)
        xyz = xyz - _solved(normal + 1e-6 * trace[:, None, None] * np.eye(3), gradient)
    depth = view.residuals(xyz)[2]
    xyz[~(np.minimum.reduceat(np.nan_to_num(depth, nan=-1.0), start) > NEAR_M)] = np.nan
    return xyz


def reprojection_errors(cameras: Sequence[Camera], xyz: np.ndarray, tracks: Tracks) -> np.ndarray:
    """(O,) pixels between each observation and the projection of its point; infinite for points that are NaN."""
    if not len(tracks):
        return np.zeros(0)
    error = np.linalg.norm(_Views(cameras, tracks).residuals(xyz)[0], axis=1)
    return np.where(np.isnan(error), np.inf, error)


def track_errors(cameras: Sequence[Camera], tracks: Tracks) -> np.ndarray:
    """(O,) reprojection errors of tracks after triangulation, pixels."""
    return reprojection_errors(cameras, triangulated(cameras, tracks), tracks)


def parallax_deg(cameras: Sequence[Camera], xyz: np.ndarray, tracks: Tracks) -> np.ndarray:
    """(M,) degrees between each point's first ray and the one farthest from it."""
    start = np.flatnonzero(np.diff(tracks.point, prepend=-1))
    centre = np.stack([camera.centre for camera in cameras])[tracks.frame]
    ray = xyz[tracks.point] - centre
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    cosine = np.einsum("oi,oi->o", ray, ray[start][tracks.point])
    return np.degrees(np.arccos(np.minimum.reduceat(cosine, start).clip(-1.0, 1.0)))


def _solved(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """(M, 3) solutions of (M, 3, 3) symmetric systems, NaN where there is none."""
    well = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(vector).all(axis=1)
    well[well] &= np.linalg.cond(matrix[well]) < 1e8
    found = np.full(vector.shape, np.nan)
    found[well] = np.linalg.solve(matrix[well], vector[well][..., None])[..., 0]
    return found


class _Views:
    """The camera of each observation."""

    def __init__(self, cameras: Sequence[Camera], tracks: Tracks) -> None:
        K = np.stack([camera.K for camera in cameras])[tracks.frame]
        pose = np.stack([camera.cam_from_world for camera in cameras])[tracks.frame]
        self.rotation, self.translation, self._point = pose[:, :3, :3], pose[:, :3, 3], tracks.point
        self._focal, self._principal, self._pixel = K[:, (0, 1), (0, 1)], K[:, :2, 2], tracks.pixel.astype(np.float64)
        across = (self._pixel - self._principal) / self._focal
        self.ray = np.concatenate([across, np.ones((len(across), 1))], axis=1)

    def residuals(self, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(O, 2) projected minus seen pixels, (O, 2, 3) their derivatives by the point, (O,) depths."""
        in_cam = np.einsum("oij,oj->oi", self.rotation, xyz[self._point]) + self.translation
        depth = in_cam[:, 2]
        z = np.where(depth > 1e-6, depth, np.nan)[:, None]
        off = in_cam[:, :2] / z * self._focal + self._principal - self._pixel
        turned = self.rotation[:, :2] - (in_cam[:, :2] / z)[..., None] * self.rotation[:, 2:]
        return off, turned * (self._focal / z)[..., None], depth
