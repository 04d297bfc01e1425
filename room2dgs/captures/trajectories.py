"""Poses at times: what lies between two of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from room2dgs.captures.capture import Lost

MAX_APART_S = 0.02  # of what counts as one moment
MAX_GAP_S = 0.2  # of the poses around a photo


def pose_at_time(
    stamp: float, stamps: np.ndarray, poses: np.ndarray, max_gap_s: float = MAX_GAP_S
) -> np.ndarray | Callable[[], np.ndarray]:
    """(4, 4) at a time: the poses around it blended, the rotation along the shortest arc.

    Args:
        stamps: (N,) seconds, in order; poses: (N, 4, 4).

    Returns:
        The pose; if they are far in time, a function that raises `Lost`.
    """
    after = int(np.searchsorted(stamps, stamp))
    if after < len(stamps) and stamps[after] == stamp:
        return poses[after]
    if after == 0 or after == len(stamps):
        nearest = min(max(after - 1, 0), len(stamps) - 1)
        return poses[nearest] if abs(stamps[nearest] - stamp) <= MAX_APART_S else lost_at(stamp)
    gap = stamps[after] - stamps[after - 1]
    if gap > max_gap_s:
        return lost_at(stamp)
    from scipy.spatial.transform import Rotation, Slerp

    pair = Rotation.from_matrix(poses[after - 1 : after + 1, :3, :3])
    share = (stamp - stamps[after - 1]) / gap
    pose = np.eye(4)
    pose[:3, :3] = Slerp([0.0, 1.0], pair)(share).as_matrix()
    pose[:3, 3] = (1 - share) * poses[after - 1, :3, 3] + share * poses[after, :3, 3]
    return pose


def lost_at(stamp: float) -> Callable[[], np.ndarray]:
    """A pose that is none."""

    def lost():
        raise Lost(f"no pose near its time {stamp:.6f}")

    return lost
