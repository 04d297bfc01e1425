"""How far off a depth camera's pixels may be: by distance, by the angle of the surface, and near depth edges."""

from __future__ import annotations

import cv2
import numpy as np

from room2dgs.config import SensorConfig
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.depth_maps import depth_normals

LATERAL_PX = 1.0  # a depth pixel's place in the image is good to about this
NORMAL_STEP = 2  # pixels to either side
UNKNOWN_TAN = 1.0  # of the angle to the ray where there is no normal: 45 degrees
EDGE_JUMP = 0.05  # of inverse depth; what bends it more is an edge
EDGE_PX = 2  # so near to an edge a pixel may belong to the other surface
EDGE_SHARE = 0.5  # of the jump, at the edge


def expected_error(depth: np.ndarray, camera: Camera, settings: SensorConfig) -> np.ndarray:
    """Expected |error| of each pixel of a depth camera.

    e = hypot(error_m + error_per_m2 z^2, z tan(angle) LATERAL_PX / f) + e_edge: noise grows with the square of the
    distance (Nguyen et al. 2012, Khoshelham and Elberink 2012), on a slanted surface an uncertain place in the image is
    an uncertain depth, and near an edge a pixel may have the depth of the surface behind it.

    Args:
        depth: (H, W) float32 z-depth, metres, at the size at which the camera measures; 0 = invalid.
        camera: of that size.
        settings: noise and reach.

    Returns:
        (H, W) float32 metres; infinite where the depth is invalid or out of reach.
    """
    known = in_reach(depth, settings)
    z = np.where(known, depth, 0.0).astype(np.float64)
    facing = settings.error_m + settings.error_per_m2 * z**2
    slanted = z * _tan_to_ray(z, camera) * LATERAL_PX / float(camera.K[0, 0])
    error = np.hypot(facing, slanted) + _at_edges(z, known)
    return np.where(known, error, np.inf).astype(np.float32)


def in_reach(depth: np.ndarray, settings: SensorConfig) -> np.ndarray:
    """(H, W) bool: valid and neither too near nor too far."""
    return (depth > 0) & (depth >= settings.min_m) & (depth <= settings.max_m)


def _tan_to_ray(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) tangent of the angle between the surface's normal and the ray; `UNKNOWN_TAN` without a normal."""
    normal = depth_normals(depth, camera, NORMAL_STEP)
    rays = camera.rays()
    cosine = np.abs((normal * rays).sum(axis=-1)) / np.linalg.norm(rays, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    return np.where(normal.any(axis=-1), np.minimum(tangent, 100.0), UNKNOWN_TAN)


def _at_edges(depth: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(H, W) metres: a share of the jump of the nearest depth edge, less with each pixel away from it."""
    near = np.ones((3, 3), np.uint8)
    far_side = cv2.dilate(depth, near)
    near_side = cv2.erode(np.where(known, depth, np.inf), near)
    jump = np.where(_edges(depth, known), far_side - near_side, 0.0)
    error = np.zeros_like(depth)
    for away in range(EDGE_PX + 1):
        share = EDGE_SHARE * (1.0 - away / (EDGE_PX + 1))
        error = np.maximum(error, share * cv2.dilate(jump, np.ones((2 * away + 1,) * 2, np.uint8)))
    return error


def _edges(depth: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(H, W) bool where inverse depth bends; on a plane it is linear in the image, however slanted."""
    inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=known)
    found = np.zeros(depth.shape, bool)
    for value, there, mark in ((inverse, known, found), (inverse.T, known.T, found.T)):
        before, here, after = value[:-2], value[1:-1], value[2:]
        bend = np.abs(before - 2 * here + after)
        least = np.minimum(np.minimum(before, here), after)
        mark[1:-1] |= there[:-2] & there[1:-1] & there[2:] & (bend > EDGE_JUMP * least)
    return found
