"""The speed of stereo: which windows are counted, what the ratios are of."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs import splat
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.patchmatch import Matching
from room2dgs.tools.stereo_check import speed as stereo_speed
from room2dgs.tools.stereo_check.speed import bare_seconds, nearest, windows_seen

WIDTH, HEIGHT = 40, 12


def looking_along_z(x: float) -> Camera:
    """A camera at (x, 0, 0)."""
    pose = np.eye(4)
    pose[0, 3] = -x
    return Camera(np.array([[40.0, 0, WIDTH / 2], [0, 40.0, HEIGHT / 2], [0, 0, 1]]), WIDTH, HEIGHT, pose)


def test_vectors_are_counted_of_which_a_pixel_is_seen():
    here = looking_along_z(0.0)
    wall = np.full((HEIGHT, WIDTH), 0.5)
    # rows 2 to 9 are far enough from the border; 40 pixels are three vectors of each colour
    assert windows_seen(here, looking_along_z(0.0), wall) == 8 * 3 * 2
    # shifted by 20 pixels: pixels 22 to 39 are seen, which lie in two of the three
    assert windows_seen(here, looking_along_z(1.0), wall) == 8 * 2 * 2
    # by 30 pixels: 32 to 39, in the last
    assert windows_seen(here, looking_along_z(1.5), wall) == 8 * 1 * 2
    assert windows_seen(here, looking_along_z(3.0), wall) == 0
    behind = looking_along_z(0.0)
    behind.cam_from_world[2, 3] = -3.0  # past the wall
    assert windows_seen(here, behind, wall) == 0


def test_the_nearest_views_are_chosen():
    cameras = [looking_along_z(x) for x in (0.0, 0.5, -0.2, 2.0, 0.1)]
    assert nearest(cameras, 0, 3) == [4, 2, 1]
    assert nearest(cameras, 3, 9) == [1, 4, 0, 2]


def test_more_samples_of_a_window_take_longer():
    """The bare loop is the comparison of windows, so that its time grows with their samples: here 4.8 times as many."""
    threads = splat.set_threads(1)
    try:
        few, many = (bare_seconds(Matching(radius=radius, step=2)) for radius in (4, 10))
    finally:
        splat.set_threads()
    assert threads == 1
    assert 1e-9 < few < 1e-4
    assert many > 2 * few


def test_scaling_is_seconds_on_one_thread_by_those_on_all(monkeypatch):
    used, clock = [], [0.0]
    monkeypatch.setattr(stereo_speed, "set_threads", used.append)
    monkeypatch.setattr(stereo_speed.time, "perf_counter", lambda: clock[0])

    def stage(frames, *_):
        clock[0] += len(frames) * 6.0 / used[-1]
        return None, iter(())

    monkeypatch.setattr(stereo_speed, "scene_stereo", stage)
    assert stereo_speed.thread_scaling([None] * 3, None, None, 4) == pytest.approx(4.0)
    assert used == [1, 4]
    assert stereo_speed.thread_scaling([None] * 3, None, None, 1) == 1.0
