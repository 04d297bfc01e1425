"""Errors of poses as trackers make them: a drift that grows along the way, and jumps where the place is recognised.

Visual-inertial odometry adds up small motions: its error per metre walked is smooth, and neighbouring photos are off by
nearly the same. When the tracker recognises a place, it corrects the pose at once (relocalisation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from room2dgs.geometry.poses import inverse_pose

SMOOTH_M = 2.0  # correlation length of the drift's direction along the way
AFTER_CM, AFTER_DEGREES = 1.0, 0.2  # root mean square error of a pose right after a relocalisation


@dataclass(frozen=True)
class Drift:
    """How fast a tracker drifts.

    Attributes:
        cm_per_m: root mean square error of the motion between photos, for each metre walked.
        degrees_per_m: the same of its rotation.
        relocalise_m: metres walked between two relocalisations, on average; infinite: there are none.
    """

    cm_per_m: float = 2.0
    degrees_per_m: float = 0.35
    relocalise_m: float = 5.0


def drifted(world_from_cam: np.ndarray, drift: Drift, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Poses as a drifting tracker gives them; the first one is exact.

    Args:
        world_from_cam: (N, 4, 4) true poses in the order in which they were walked, metres.

    Returns:
        (N, 4, 4) poses, and (N,) bool: the photos at which the tracker relocalised.
    """
    found = np.array(world_from_cam, dtype=np.float64)
    jumps = np.zeros(len(found), dtype=bool)
    velocity = _standard(random)  # translation and rotation per metre, each of mean square 1
    left_m = random.exponential(drift.relocalise_m)
    for index in range(1, len(found)):
        true_motion = inverse_pose(world_from_cam[index - 1]) @ world_from_cam[index]
        walked_m = float(np.linalg.norm(true_motion[:3, 3]))
        same = math.exp(-walked_m / SMOOTH_M)
        velocity = same * velocity + math.sqrt(1 - same**2) * _standard(random)
        left_m -= walked_m
        if left_m <= 0:
            jumps[index] = True
            left_m = random.exponential(drift.relocalise_m)
            found[index] = world_from_cam[index] @ _small_motion(_standard(random), AFTER_CM, AFTER_DEGREES)
        else:
            error = _small_motion(velocity * walked_m, drift.cm_per_m, drift.degrees_per_m)
            found[index] = found[index - 1] @ true_motion @ error
    return found, jumps


def _standard(random: np.random.Generator) -> np.ndarray:
    """(2, 3) two random vectors of mean square length 1."""
    return random.normal(size=(2, 3)) / math.sqrt(3)


def _small_motion(sizes: np.ndarray, cm: float, degrees: float) -> np.ndarray:
    """(4, 4) rigid motion: (2, 3) translation in units of `cm` and rotation vector in units of `degrees`."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(math.radians(degrees) * sizes[1]).as_matrix()
    motion[:3, 3] = 0.01 * cm * sizes[0]
    return motion
