"""Stereo's pixels as points."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.config import StereoConfig, load_config
from room2dgs.geometry.camera import Camera
from room2dgs.stereo import anchors
from room2dgs.stereo.anchors import TRUST, FirstLook, stereo_points, trust, with_stereo, with_windows
from room2dgs.stereo.dense import DenseView

CAMERA = Camera(np.array([[60.0, 0, 40], [0, 60, 30], [0, 0, 1]]), 80, 60, np.eye(4))


def frame() -> Frame:
    return Frame(name="a", color_path=Path("a.jpg"), camera=CAMERA)


def view() -> tuple[Camera, DenseView]:
    """Half the photo's size: a slanted wall on the right half, on which 2 or 7 views agree."""
    camera = CAMERA.resized(40, 30)
    depth = np.zeros((30, 40), np.float32)
    depth[:, 20:] = np.linspace(2, 3, 20, dtype=np.float32)
    agreeing = np.where(np.arange(30)[:, None] < 15, 2, 7).astype(np.uint8) * (depth > 0)
    zero = np.zeros_like(depth)
    return camera, DenseView(
        depth, np.zeros((30, 40, 3), np.float32), agreeing, zero, np.zeros((3, 30, 40), np.float32)
    )


def test_a_pixel_becomes_a_point_where_its_photo_sees_it_with_the_trust_of_its_agreeing_views():
    camera, dense = view()
    sparse = PointCloud(
        np.array([[0.0, 0, 2]]),
        np.zeros((1, 3), np.uint8),
        Tracks(("b",), np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[1.0, 1]], np.float32)),
    )
    both = with_stereo(sparse, [frame()], [camera], {"a": (dense.depth, dense.agreeing)})
    assert len(both) == 1 + np.count_nonzero(dense.depth)
    assert both.weight_of(np.array([0])) == 1
    seen = seen_points(both, frame())
    column, row = (seen.pixel / 2).astype(int).T
    np.testing.assert_allclose(seen.depth, dense.depth[row, column], rtol=1e-6)
    np.testing.assert_allclose(both.weight_of(seen.index), trust(dense.agreeing[row, column]))
    projected, _ = CAMERA.project(both.xyz[seen.index])
    np.testing.assert_allclose(projected, seen.pixel, atol=1e-4)


def test_points_without_tracks_stay_among_those_that_photos_see():
    camera, dense = view()
    both = with_stereo(
        PointCloud(np.array([[0.0, 0, 2]]), np.zeros((1, 3), np.uint8)),
        [frame()],
        [camera],
        {"a": (dense.depth, dense.agreeing)},
    )
    assert 0 in seen_points(both, frame()).index


def test_trust_grows_with_the_views_that_agree():
    assert trust(np.array([0])) == 0 and trust(np.array([200])) == 1
    assert (np.diff(TRUST) > 0).all()


def test_a_second_look_begins_with_the_completed_depth_and_keeps_what_only_the_first_found(monkeypatch):
    """The second finds the right half of a photo; the first, at half its size, had the upper half."""
    camera, dense = view()
    upper = np.zeros((15, 20), np.float32)
    upper[:7] = 4.0
    first = FirstLook({"a": np.full((60, 80), 3, np.float32)}, {"a": (upper, np.uint8(3) * (upper > 0))})
    begun, lines = [], []

    def stage(frames, points, settings, log, device, start, beside):
        begun.append((settings.width, start, beside))
        return [camera], iter([(dense.depth, dense.agreeing)])

    monkeypatch.setattr(anchors, "scene_second_look", stage)
    monkeypatch.setattr(anchors, "grey", lambda frame, camera: np.full((30, 40), 128, np.uint8))
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    settings = load_config(["scene.path=a", "out=b", "stereo.width=70"]).stereo
    others = [frame()]
    found = stereo_points([frame()], nothing, settings, lines.append, first=first, looks=2, beside=others)
    depth, agreeing = found.maps["a"]
    assert begun == [(70, first.completed, others)] and "from the completed depth: 73%" in lines[0]
    there = dense.depth > 0
    np.testing.assert_array_equal(depth[there], dense.depth[there])
    np.testing.assert_array_equal(agreeing[there], dense.agreeing[there])
    np.testing.assert_allclose(depth[:14, :20], 4.0)
    assert (agreeing[:14, :20] == 3).all() and not depth[14:, :20].any() and not agreeing[14:, :20].any()
    sharp = np.tile(np.uint8(255) * (np.arange(40) // 4 % 2 == 1), (30, 1))
    monkeypatch.setattr(anchors, "grey", lambda frame, camera: sharp)
    depth, agreeing = stereo_points([frame()], nothing, settings, lines.append, first=first, looks=2).maps["a"]
    np.testing.assert_array_equal(depth, dense.depth)  # where the photo has contrast, the first look's is not believed
    np.testing.assert_array_equal(agreeing, dense.agreeing)


@pytest.mark.parametrize(
    ("photo", "setting", "looks", "width"),
    [
        (640, 640, 2, 320),
        (1296, None, 2, 648),
        (500, 640, 2, 320),
        (320, 640, 2, 320),
        (80, 60, 2, 60),
        (640, 500, 1, 500),
    ],
)
def test_the_first_of_two_looks_is_at_half_the_width_down_to_320(monkeypatch, photo, setting, looks, width):
    camera, dense = view()
    widths = []

    def stage(frames, points, settings, log, device, beside):
        widths.append(settings.width)
        return [camera], iter([dense])

    monkeypatch.setattr(anchors, "scene_stereo", stage)
    settings = replace(load_config(["scene.path=a", "out=b"]).stereo, width=setting)
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    wide = replace(frame(), camera=CAMERA.resized_to_width(photo))
    stereo_points([wide], nothing, settings, lambda line: None, looks=looks)
    assert widths == [width]


@pytest.mark.parametrize(
    ("photo", "setting", "looks", "window"),
    [
        (640, 640, 2, (4, 2)),
        (1296, None, 2, (4, 2)),
        (500, 640, 2, (4, 2)),
        (320, 640, 2, (2, 1)),
        (200, None, 2, (2, 1)),
        (640, 640, 1, (4, 2)),
    ],
)
def test_windows_of_the_second_look_cover_half_as_much(monkeypatch, photo, setting, looks, window):
    camera, dense = view()
    windows = []

    def stage(frames, points, settings, log, device, start, beside):
        windows.append((settings.radius, settings.step))
        return [camera], iter([(dense.depth, dense.agreeing)])

    monkeypatch.setattr(anchors, "scene_second_look", stage)
    settings = replace(load_config(["scene.path=a", "out=b"]).stereo, width=setting)
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    wide = replace(frame(), camera=CAMERA.resized_to_width(photo))
    stereo_points([wide], nothing, settings, lambda line: None, first=FirstLook({}, {}), looks=looks)
    assert windows == [window]


@cache
def defaults() -> StereoConfig:
    return load_config(["scene.path=a", "out=b"]).stereo


@settings(deadline=None)  # the first one reads the configuration
@given(st.integers(1, 12), st.integers(1, 12), st.floats(0.5, 10))
def test_other_windows_have_as_many_samples_and_fit_the_kernels(radius, step, times):
    assume(step <= radius and radius // step <= 5)
    other = with_windows(replace(defaults(), radius=radius, step=step), times)
    assert other.radius // other.step == radius // step and other.radius % other.step == 0
    asked = max(1, round(step * times))
    assert min(step, asked) <= other.step <= max(step, asked) and other.radius <= 12
