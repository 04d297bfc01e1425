"""Which photos, windows and depths the passes over a capture take."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import StereoConfig, load_config
from room2dgs.geometry.camera import Camera
from room2dgs.stereo import passes
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.depth_samples import stereo_samples
from room2dgs.stereo.passes import FirstPass, StereoInput, StereoMap, with_windows

CAMERA = Camera(np.array([[60.0, 0, 40], [0, 60, 30], [0, 0, 1]]), 80, 60, np.eye(4))
NOTHING = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
BLANK = np.full((30, 40), 128, np.uint8)
SHARP = np.tile(np.uint8(255) * (np.arange(40) // 4 % 2 == 1), (30, 1))


def frame(width: int = 80) -> Frame:
    return Frame(name="a", color_path=Path("a.jpg"), camera=CAMERA.resized_to_width(width))


def view(width: int, height: int, there: tuple[slice, slice], depth: float, num_consistent: int) -> DenseView:
    """Depth in a part of the photo."""
    z, count = np.zeros((height, width), np.float32), np.zeros((height, width), np.uint8)
    z[there], count[there] = depth, num_consistent
    zero = np.zeros_like(z)
    return DenseView(z, np.zeros((height, width, 3), np.float32), count, zero, np.zeros((3, height, width), np.float32))


RIGHT, UPPER = (slice(None), slice(20, None)), (slice(0, 7), slice(None))  # of 40 x 30, of 20 x 15
FINE, ROUGH = view(40, 30, RIGHT, 2.0, 7), view(20, 15, UPPER, 4.0, 3)


def quiet(_line: str) -> None:
    pass


@cache
def defaults() -> StereoConfig:
    return load_config(["scene.path=a", "out=b"]).stereo


@pytest.fixture(autouse=True)
def _consistency_as_counted(monkeypatch):
    monkeypatch.setattr(
        passes, "calibrated_consistency", lambda view, num_consistent, others, max_px, max_relative: num_consistent
    )


@pytest.fixture
def first(monkeypatch):
    """The photo, to be set, and the settings of each search; the second finds the right half, the first the upper."""
    photo, asked = [BLANK], []

    def stage(frames, points, settings, log, device, beside):
        asked.append((settings.width, settings.radius, settings.step, beside))
        found = ROUGH if len(asked) == 1 else FINE
        return [CAMERA.resized(*found.depth.shape[::-1])], iter([found])

    monkeypatch.setattr(passes, "scene_stereo", stage)
    monkeypatch.setattr(passes, "grey", lambda frame, camera: photo[0])
    return photo, asked


def test_on_blank_walls_the_first_pass_has_wide_windows_where_narrow_ones_find_nothing(first):
    photo, asked = first
    lines: list[str] = []
    photos = StereoInput([frame()], (), NOTHING, defaults(), lines.append)
    depth, num_consistent = stereo_samples(photos, passes=2).maps["a"]
    assert len(asked) == 2 and "73%" in lines[0]
    np.testing.assert_array_equal(depth[:, 20:], 2.0)
    np.testing.assert_array_equal(num_consistent[:, 20:], 7)
    np.testing.assert_allclose(depth[:14, :20], 4.0)
    assert (num_consistent[:14, :20] == 3).all() and not depth[14:, :20].any() and not num_consistent[14:, :20].any()
    photo[0] = SHARP
    asked.clear()
    depth, num_consistent = stereo_samples(photos, passes=2).maps["a"]
    np.testing.assert_array_equal(depth, FINE.depth)  # where the photo has contrast, wide windows are not believed
    np.testing.assert_array_equal(num_consistent, FINE.num_consistent)


@pytest.mark.parametrize(
    ("photo", "setting", "first_width", "wide"),
    [(640, 640, 320, 160), (1296, None, 648, 324), (500, 640, 320, 160), (320, 640, 320, 160), (200, 640, 200, 160),
     (80, 60, 60, 60)],
)  # fmt: skip
def test_the_first_of_two_passes_is_at_half_the_width_down_to_320(first, photo, setting, first_width, wide):
    beside = [frame()]
    asked = replace(defaults(), width=setting)
    stereo_samples(StereoInput([frame(photo)], beside, NOTHING, asked, quiet), passes=2)
    assert first[1] == [(wide, 4, 2, beside), (first_width, 2, 1, beside)]


def test_an_only_pass_is_at_full_size(first):
    depth, _ = stereo_samples(StereoInput([frame(640)], (), NOTHING, replace(defaults(), width=500), quiet)).maps["a"]
    assert first[1] == [(500, 4, 2, ())]
    np.testing.assert_array_equal(depth, ROUGH.depth)


def test_a_second_pass_begins_with_the_completed_depth_and_keeps_what_only_the_first_found(monkeypatch):
    before = FirstPass({"a": np.full((60, 80), 3, np.float32)}, {"a": StereoMap(ROUGH.depth, ROUGH.num_consistent)})
    begun, lines = [], []

    def stage(frames, points, settings, log, device, start, beside):
        begun.append((settings.width, start, beside))
        return [CAMERA.resized(40, 30)], iter([(FINE.depth, FINE.num_consistent)])

    monkeypatch.setattr(passes, "scene_second_pass", stage)
    others, asked = [frame()], replace(defaults(), width=70)
    found = stereo_samples(StereoInput([frame()], others, NOTHING, asked, lines.append), before, passes=2)
    depth, num_consistent = found.maps["a"]
    assert begun == [(70, before.completed, others)] and "from the completed depth: 73%" in lines[0]
    np.testing.assert_array_equal(depth[:, 20:], 2.0)
    np.testing.assert_array_equal(num_consistent[:, 20:], 7)
    np.testing.assert_allclose(depth[:14, :20], 4.0)
    assert (num_consistent[:14, :20] == 3).all() and not depth[14:, :20].any() and not num_consistent[14:, :20].any()


@pytest.mark.parametrize(
    ("photo", "setting", "window"),
    [(640, 640, (4, 2)), (1296, None, (4, 2)), (500, 640, (4, 2)), (320, 640, (2, 1)), (200, None, (2, 1))],
)
def test_windows_of_the_second_pass_cover_as_much_as_the_first_ones_narrow_ones(monkeypatch, photo, setting, window):
    windows = []

    def stage(frames, points, settings, log, device, start, beside):
        windows.append((settings.radius, settings.step))
        return [CAMERA], iter([(FINE.depth, FINE.num_consistent)])

    monkeypatch.setattr(passes, "scene_second_pass", stage)
    asked = replace(defaults(), width=setting)
    stereo_samples(StereoInput([frame(photo)], (), NOTHING, asked, quiet), FirstPass({}, {}), passes=2)
    assert windows == [window]


@pytest.mark.parametrize("second", [False, True])
def test_depth_counts_by_calibrated_consistency_and_without_any_it_is_no_depth(monkeypatch, second):
    """The neighbour's depth is asked for."""
    frames = [frame(), replace(frame(), name="b")]
    cameras = [CAMERA.resized(40, 30)] * 2
    monkeypatch.setattr(passes, "scene_stereo", lambda *_: (cameras, iter([FINE, FINE])))
    monkeypatch.setattr(
        passes, "scene_second_pass", lambda *_: (cameras, iter([(FINE.depth, FINE.num_consistent)] * 2))
    )
    monkeypatch.setattr(passes, "scene_neighbours", lambda *_: [np.array([1]), np.array([0])])
    monkeypatch.setattr(passes, "grey", lambda *_: SHARP)  # nothing is believed of wide windows

    def two_at_most(view, num_consistent, others, max_px, max_relative):
        assert len(others) == 1 and others[0][1] is FINE.depth and (max_px, max_relative) == (1.0, 0.01)
        return np.where(np.arange(40) < 30, np.minimum(num_consistent, 2), 0).astype(np.uint8)

    monkeypatch.setattr(passes, "calibrated_consistency", two_at_most)
    before = FirstPass({}, {}) if second else None
    found = stereo_samples(StereoInput(frames, (), NOTHING, defaults(), quiet), before, passes=2)
    for depth, num_consistent in found.maps.values():
        np.testing.assert_array_equal(num_consistent, np.where((FINE.num_consistent > 0) & (np.arange(40) < 30), 2, 0))
        np.testing.assert_array_equal(depth > 0, num_consistent > 0)


@settings(deadline=None)  # the first one reads the configuration
@given(st.integers(1, 12), st.integers(1, 12), st.floats(0.5, 10))
def test_other_windows_have_as_many_samples_and_fit_the_kernels(radius, step, times):
    assume(step <= radius and radius // step <= 5)
    other = with_windows(replace(defaults(), radius=radius, step=step), times)
    assert other.radius // other.step == radius // step and other.radius % other.step == 0
    asked = max(1, round(step * times))
    assert min(step, asked) <= other.step <= max(step, asked) and other.radius <= 12
