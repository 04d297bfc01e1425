"""Captures far from the origin of their world (UTM, ECEF): a run works in metres from a round point beside them.

Kernels, libraries and file formats count in float32, whose steps at 500 km are 3 cm and at 5,000 km half a metre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose

Origin = tuple[float, float, float]
AT_ORIGIN: Origin = (0.0, 0.0, 0.0)
MAX_STEP_M = 1e-4  # steps of float32 that a room's coordinates may have; it has larger ones beyond 1024 m
ROUNDED_M = 1e-3  # steps of poses that a person should know of
ROUND_M = 100.0  # whole numbers are taken away and put back without an error


def too_far_for_float32(xyz: np.ndarray) -> bool:
    """Whether float32 would round some of the coordinates (..., 3), metres, to steps of more than 0.1 mm."""
    largest = np.abs(np.asarray(xyz, np.float64)).max(initial=0.0)
    return bool(np.isfinite(largest) and np.spacing(np.float32(largest)) > MAX_STEP_M)


def origin_beside(centre: np.ndarray) -> Origin:
    """Where a scene with a camera at (3,) has its origin, in the capture's world, metres.

    All zeros unless the camera is too far for float32; then the nearest whole 100 m.
    """
    if not too_far_for_float32(centre):
        return AT_ORIGIN
    x, y, z = (float(ROUND_M * np.round(value / ROUND_M)) + 0.0 for value in centre)
    return x, y, z


def in_scene(world_from_cam: np.ndarray, origin_m: Origin) -> np.ndarray:
    """(4, 4) scene_from_cam."""
    pose = np.array(world_from_cam, np.float64)
    pose[:3, 3] -= origin_m
    return pose


def in_world(scene_from_cam: np.ndarray, origin_m: Origin) -> np.ndarray:
    """(4, 4) world_from_cam, the way back from `in_scene`."""
    pose = np.array(scene_from_cam, np.float64)
    pose[:3, 3] += origin_m
    return pose


def camera_in_scene(camera: Camera, origin_m: Origin) -> Camera:
    """A camera of the capture's world."""
    if origin_m == AT_ORIGIN:
        return camera
    return replace(camera, cam_from_world=inverse_pose(in_scene(camera.world_from_cam, origin_m)))


def camera_in_world(camera: Camera, origin_m: Origin) -> Camera:
    """The way back from `camera_in_scene`."""
    if origin_m == AT_ORIGIN:
        return camera
    return replace(camera, cam_from_world=inverse_pose(in_world(camera.world_from_cam, origin_m)))


def xyz_in_world(xyz: np.ndarray, origin_m: Origin) -> np.ndarray:
    """(N, 3) float64 of points (N, 3) in the scene's frame."""
    return xyz if origin_m == AT_ORIGIN else np.asarray(xyz, np.float64) + origin_m


def points_in_scene(read: Callable[[], PointCloud], origin_m: Origin) -> PointCloud:
    """Points that were read in the capture's world, in the scene's frame."""
    points = read()
    return points if origin_m == AT_ORIGIN else replace(points, xyz=points.xyz - np.array(origin_m))


def rounded_centres(world_from_cam: Sequence[np.ndarray], origin_m: Origin) -> list[str]:
    """A warning where the poses (4, 4) were written in float32, far from the origin: their digits are gone."""
    centres = np.stack([pose[:3, 3] for pose in world_from_cam])
    if origin_m == AT_ORIGIN or not np.array_equal(centres, centres.astype(np.float32)):
        return []
    step_m = float(np.spacing(np.abs(centres).max().astype(np.float32)))
    if step_m < ROUNDED_M:
        return []
    return [
        f"the poses are written in float32, far from the origin: they are rounded to steps of {100 * step_m:.2g} cm; "
        "write them in double, or with the offset taken out"
    ]


def offset_note(origin_m: Origin) -> list[str]:
    """What the log says of it."""
    if origin_m == AT_ORIGIN:
        return []
    place = ", ".join(f"{value:,.0f}" for value in origin_m)
    return [
        f"coordinates: far from the world's origin, so the run counts from ({place}) m; meshes, points and cameras "
        "that it writes are put back there, and files that cannot hold such numbers say so (metrics.json has it as "
        "capture.origin_m)"
    ]
