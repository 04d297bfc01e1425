"""A smooth path through given cameras: a spline of positions and one of rotations over the same parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose, rigid_pose

M_PER_RADIAN = 1.0  # so much walking is as long as a radian of turning
SAME = 1e-6  # metres: two cameras in a row that are so near are one


def smooth_path(cameras: Sequence[Camera], count: int, through: int | None = None) -> list[Camera]:
    """Cameras along a path whose velocity and acceleration, of walking and of turning, have no jumps.

    It begins at the first camera, ends at the last and passes through those between: positions are a cubic spline,
    rotations a spline in SO(3) whose angular acceleration is continuous. The parameter is the length of the way, walked
    and turned, so that the speed is nearly the same everywhere.

    Args:
        cameras: at least one; size and intrinsics of all are the first's.
        count: of the result; at least 1.
        through: it passes through so many of them, evenly spaced in their order: a walk's jitter stays out of it; at
            least 2. None: all.

    Returns:
        `count` cameras, evenly spaced along the parameter.
    """
    chosen = list(cameras)
    if through is not None and through < len(chosen):
        chosen = [chosen[index] for index in np.linspace(0, len(chosen) - 1, max(2, through)).round().astype(int)]
    kept, at = [chosen[0]], [0.0]
    for camera in chosen[1:]:
        turned = Rotation.from_matrix(camera.rotation @ kept[-1].rotation.T).magnitude()
        length = float(np.linalg.norm(camera.centre - kept[-1].centre)) + M_PER_RADIAN * float(turned)
        if length > SAME:
            kept.append(camera)
            at.append(at[-1] + length)
    if len(kept) == 1:
        return [kept[0]] * count
    times = np.linspace(0, at[-1], count)
    centres = CubicSpline(at, np.stack([camera.centre for camera in kept]), bc_type="natural")(times)
    turns = RotationSpline(at, Rotation.from_matrix(np.stack([camera.rotation.T for camera in kept])))(times)
    return [
        replace(kept[0], cam_from_world=inverse_pose(rigid_pose(turn, centre)))
        for turn, centre in zip(turns.as_matrix(), centres, strict=True)
    ]
