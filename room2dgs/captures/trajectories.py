"""Interpolates poses in time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from room2dgs.captures.capture import lost

MAX_APART_S = 0.02  # of what counts as one moment
MAX_GAP_S = 0.2  # of the poses around a photo
SAME_TIME_S = 0.001  # of a pose that was written for a photo
# the least of numbers that are times of our days in a unit, its seconds, and what it is called; seconds are below all
UNITS = ((1e17, 1e-9, "nanoseconds"), (1e14, 1e-6, "microseconds"), (1e11, 1e-3, "milliseconds"))


def in_seconds(stamps: np.ndarray) -> tuple[np.ndarray, str]:
    """Times since 1970 as seconds, and what they were by their size where it was not that ("milliseconds").

    Args:
        stamps: (N,) seconds, or whole milli-, micro- or nanoseconds.
    """
    usual = float(np.median(stamps)) if len(stamps) else 0.0
    for least, unit, name in UNITS:
        if usual >= least:
            return stamps * unit, name
    return stamps, ""


def written_for(photos: np.ndarray, stamps: np.ndarray) -> bool:
    """Whether poses are at the photos' own times: most of them are. Then one that is missing is not blended of others.

    Args:
        photos: (M,) seconds, in order; stamps: (N,) of the poses.
    """
    if not len(photos) or not len(stamps):
        return False
    after = np.searchsorted(photos, stamps).clip(1, max(1, len(photos) - 1))
    apart = np.minimum(np.abs(photos[after - 1] - stamps), np.abs(photos[after.clip(max=len(photos) - 1)] - stamps))
    return bool((apart <= SAME_TIME_S).mean() > 0.5)


def pose_at_time(
    stamp: float, stamps: np.ndarray, poses: np.ndarray, max_gap_s: float = MAX_GAP_S, own: bool = False
) -> np.ndarray | Callable[[], np.ndarray]:
    """(4, 4) at a time: the poses around it blended, the rotation along the shortest arc.

    Args:
        stamps: (N,) seconds, in order; poses: (N, 4, 4).
        own: each photo has a pose of its own (`written_for`), or none.

    Returns:
        The pose; if they are far in time, a function that raises `Lost`.
    """
    after = int(np.searchsorted(stamps, stamp))
    if after < len(stamps) and stamps[after] == stamp:
        return poses[after]
    around = [index for index in (after - 1, after) if 0 <= index < len(stamps)]
    nearest = min(around, key=lambda index: abs(stamps[index] - stamp))
    apart = abs(stamps[nearest] - stamp)
    if own and apart > SAME_TIME_S:
        return lost_at(stamp)
    if len(around) == 1:
        return poses[nearest] if apart <= MAX_APART_S else lost_at(stamp)
    gap = stamps[after] - stamps[after - 1]
    if gap > max_gap_s:
        return poses[nearest] if apart <= SAME_TIME_S else lost_at(stamp)
    from scipy.spatial.transform import Rotation, Slerp

    pair = Rotation.from_matrix(poses[after - 1 : after + 1, :3, :3])
    share = (stamp - stamps[after - 1]) / gap
    pose = np.eye(4)
    pose[:3, :3] = Slerp([0.0, 1.0], pair)(share).as_matrix()
    pose[:3, 3] = (1 - share) * poses[after - 1, :3, 3] + share * poses[after, :3, 3]
    return pose


def lost_at(stamp: float) -> Callable[[], np.ndarray]:
    """A pose that is none."""
    return lost(f"no pose near its time {stamp:.6f}")
