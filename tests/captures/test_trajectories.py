"""Poses at times: blended of those around a photo, or none where they are far or where each photo had its own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.captures.capture import Lost
from room2dgs.captures.trajectories import pose_at_time, written_for


def line(stamps: np.ndarray) -> np.ndarray:
    """(N, 4, 4): a camera that goes 1 m a second along x."""
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    poses[:, 0, 3] = stamps
    return poses


def x_at(stamp: float, stamps, **options) -> float | None:
    stamps = np.asarray(stamps, np.float64)
    pose = pose_at_time(stamp, stamps, line(stamps), **options)
    if callable(pose):
        with pytest.raises(Lost, match="no pose near its time"):
            pose()
        return None
    return float(pose[0, 3])


@given(st.sets(st.integers(0, 29), min_size=4, max_size=29))
def test_poses_at_photos_own_times_are_known_as_such_whatever_lines_are_gone(left):
    photos = 100 + np.arange(30) / 30
    kept = photos[sorted(left)]
    assert written_for(photos, kept)
    for index, stamp in enumerate(photos):
        found = x_at(stamp, kept, own=True)
        assert (found is not None) == (index in left) and (found is None or found == stamp)


@pytest.mark.parametrize("rate", [100, 120, 200, 1000])
def test_a_motion_capture_is_not_written_for_the_photos(rate):
    photos = 100 + np.arange(60) / 30
    assert not written_for(photos, np.arange(100, 102, 1 / rate))
    assert not written_for(photos + 0.0042, np.arange(100, 102, 1 / 30))
    assert not written_for(np.zeros(0), photos) and not written_for(photos, np.zeros(0))


def test_between_two_poses_that_are_near_in_time_it_is_blended():
    assert x_at(0.05, [0.0, 0.1]) == pytest.approx(0.05)
    assert x_at(0.15, [0.0, 0.3]) is None
    assert x_at(0.15, [0.0, 0.3], max_gap_s=0.5) == pytest.approx(0.15)


def test_a_pose_within_a_millisecond_counts_though_the_next_is_far():
    assert x_at(0.0005, [0.0, 5.0]) == 0.0
    assert x_at(4.9995, [0.0, 5.0]) == 5.0
    assert x_at(0.005, [0.0, 5.0]) is None


def test_beyond_the_ends_the_last_pose_holds_for_a_moment():
    assert x_at(1.015, [0.9, 1.0]) == 1.0 and x_at(0.885, [0.9, 1.0]) == 0.9
    assert x_at(1.03, [0.9, 1.0]) is None and x_at(1.015, [0.9, 1.0], own=True) is None
