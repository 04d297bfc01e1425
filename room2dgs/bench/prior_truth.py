"""What a frame's depth and normals truly are: the truth that a prior is measured against.

Depth is the capture's own. A depth sensor's noise makes its normals useless (15 degrees over windows of 9 pixels), so
normals come from the ground-truth mesh where there is one and it agrees with the depth (4 cm, 2 % of it when far):

- "mesh": mesh and depth agree to a millimetre in the median, so both are exact: the triangles' own normals;
- "fused mesh": the mesh was fused from such depth: planes fitted to its ray-cast depth in small windows;
- "depth": no mesh, exact depth (quantised at most): planes fitted to the depth in smaller windows;
- "sensor depth": no mesh, noisy depth: planes fitted in large windows.

Where no plane fits (edges, creases, plants) a fitted normal is not known, and nothing is measured there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.selection import evenly_spaced
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera

AGREE_M, AGREE_SHARE = 0.04, 0.02  # a mesh further from the depth, and more than this share of it, is another surface
EXACT_M = 0.001  # median distance of an exact mesh from depth in millimetres
EXACT_RESIDUAL = 0.0005  # median relative residual of planes in 3x3 windows; a sensor's is three times that
PROBED_FRAMES = 3
REFERENCE_WIDTH = 640  # the radii below are for photos of this width
MIN_FILLED = 0.6  # of a window


class Window(NamedTuple):
    """How planes are fitted.

    Attributes:
        radius: of the square window, pixels of a photo of `REFERENCE_WIDTH`.
        max_residual: root mean square of the relative depth error, beyond which there is no plane.
    """

    radius: int
    max_residual: float


WINDOWS = {"fused mesh": Window(6, 0.01), "depth": Window(2, 0.002), "sensor depth": Window(7, 0.02)}


class Truth(NamedTuple):
    """A frame's truth at its camera's size.

    Attributes:
        depth: (H, W) float64 z-depth in metres, 0 = unknown.
        normal: (H, W, 3) float64, unit, camera frame, facing the camera; 0 = unknown.
    """

    depth: np.ndarray
    normal: np.ndarray


def truth_source(frames: Sequence[Frame], surface: Surface | None) -> str:
    """Where the normals of a capture come from: "mesh", "fused mesh", "depth" or "sensor depth".

    Args:
        frames: with depth.
        surface: the ground-truth mesh, None without.
    """
    probed = evenly_spaced(frames, PROBED_FRAMES)
    if surface is not None:
        distances = np.concatenate([_mesh_distances(frame, surface) for frame in probed])
        if len(distances) and (distances < AGREE_M).mean() > 0.5:
            return "mesh" if np.median(distances) < EXACT_M else "fused mesh"
    residuals = [fitted_planes(true_depth(frame), frame.camera, 1)[1] for frame in probed]
    known = np.concatenate([residual[np.isfinite(residual)] for residual in residuals])
    return "depth" if len(known) and np.median(known) < EXACT_RESIDUAL else "sensor depth"


def frame_truth(frame: Frame, surface: Surface | None, source: str) -> Truth:
    """Depth and normals of one frame.

    Args:
        source: what `truth_source` gives.

    Raises:
        InputError: the depth map cannot be decoded.
    """
    depth = true_depth(frame)
    if source not in ("mesh", "fused mesh") or surface is None:
        return Truth(depth, plane_normals(depth, frame.camera, source))
    hits = surface.seen_by(frame.camera)
    cast = np.where(np.isfinite(hits.t), hits.t, 0.0).astype(np.float64).reshape(depth.shape)
    agree = (depth > 0) & (cast > 0) & (np.abs(cast - depth) < np.maximum(AGREE_M, AGREE_SHARE * depth))
    if source == "fused mesh":
        return Truth(depth, plane_normals(np.where(agree, cast, 0.0), frame.camera, source))
    normal = frame.camera.turned_to_camera(surface.face_normals[hits.triangle].reshape(*depth.shape, 3))
    away = (normal * frame.camera.rays()).sum(axis=-1, keepdims=True) > 0
    return Truth(depth, np.where(agree[..., None], np.where(away, -normal, normal), 0.0))


def plane_normals(depth: np.ndarray, camera: Camera, source: str) -> np.ndarray:
    """(H, W, 3) unit normals of planes that fit the depth around each pixel, camera frame, facing the camera; 0 = none.

    Args:
        depth: (H, W) metres, 0 = unknown.
        source: a key of `WINDOWS`.
    """
    window = WINDOWS[source]
    radius = max(1, round(window.radius * camera.width / REFERENCE_WIDTH))
    normal, residual = fitted_planes(depth, camera, radius)
    return np.where((residual <= window.max_residual)[..., None], normal, 0.0)


def fitted_planes(depth: np.ndarray, camera: Camera, radius: int) -> tuple[np.ndarray, np.ndarray]:
    """The plane of least squares around each pixel: 1 / z = a x + b y + c over rays (x, y, 1), linear in a, b, c.

    Args:
        depth: (H, W) metres, 0 = unknown.
        radius: windows are 2 radius + 1 pixels a side.

    Returns:
        (H, W, 3) float64 unit normals -(a, b, c) / |(a, b, c)|, camera frame, facing the camera, 0 = none, and
        (H, W) root mean square of the relative residual of depth, inf = none (the pixel or too much of its window
        is unknown).
    """
    valid = depth > 0
    rays = camera.rays()
    x, y = rays[..., 0], rays[..., 1]
    inverse = np.where(valid, 1.0 / np.where(valid, depth, 1.0), 0.0)

    def total(values: np.ndarray) -> np.ndarray:
        side = 2 * radius + 1
        return cv2.boxFilter(values * valid, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)

    count = total(np.ones_like(depth, dtype=np.float64))
    known = valid & (count > MIN_FILLED * (2 * radius + 1) ** 2)
    count = np.where(known, count, 1.0)
    mean_x, mean_y, mean = total(x) / count, total(y) / count, total(inverse) / count
    xx, xy, yy = (total(p) / count - q for p, q in ((x * x, mean_x**2), (x * y, mean_x * mean_y), (y * y, mean_y**2)))
    xd, yd = total(x * inverse) / count - mean_x * mean, total(y * inverse) / count - mean_y * mean
    determinant = xx * yy - xy * xy
    known &= determinant > 1e-20
    determinant = np.where(known, determinant, 1.0)
    a, b = (yy * xd - xy * yd) / determinant, (xx * yd - xy * xd) / determinant
    plane = np.stack([a, b, mean - a * mean_x - b * mean_y], axis=-1)
    variance = total(inverse * inverse) / count - mean * mean - a * xd - b * yd
    residual = np.where(known, np.sqrt(np.maximum(variance, 0.0)) * depth, np.inf)
    length = np.linalg.norm(plane, axis=-1)
    # the pixel's own plane must lie in front of the camera: 1 / z > 0 there
    known &= (length > 0) & ((plane * rays).sum(axis=-1) > 0)
    normal = np.where(known[..., None], -plane / np.where(length > 0, length, 1.0)[..., None], 0.0)
    return normal, np.where(known, residual, np.inf)


def true_depth(frame: Frame) -> np.ndarray:
    """(H, W) float64 metres, 0 = unknown.

    Raises:
        InputError: the depth map cannot be decoded.
    """
    depth = frame.depth()
    if depth is None:
        raise ValueError(f"{frame.name} has no depth")
    return depth.astype(np.float64)


def _mesh_distances(frame: Frame, surface: Surface) -> np.ndarray:
    """(N,) |z-depth of the mesh - depth| where both are known, metres."""
    depth = true_depth(frame)
    cast = surface.seen_by(frame.camera).t.reshape(depth.shape)
    both = (depth > 0) & np.isfinite(cast)
    return np.abs(cast[both] - depth[both])
