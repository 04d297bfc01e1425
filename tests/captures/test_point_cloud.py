"""Tracks, what is left of them when points go, and what a photo sees with and without them."""

from pathlib import Path

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import likely_points, probably_seen, seen_points


def cloud() -> PointCloud:
    """Four points; photo "a" saw 0, 1 and 3, photo "b" 1 and 2."""
    pixel = np.array([[1.5, 2.5], [3, 4], [5, 6], [7, 8], [9, 10]], np.float32)
    frame, point = np.array([0, 0, 0, 1, 1], np.int32), np.array([0, 1, 3, 1, 2], np.int32)
    xyz = np.array([[0, 0, 2.0], [0.1, 0, 2], [0, 0.1, 2], [0.1, 0.1, 2]])
    return PointCloud(xyz, np.arange(12, dtype=np.uint8).reshape(4, 3), Tracks(("a", "b"), frame, point, pixel))


def photo(name: str, pose: np.ndarray | None = None, width: int = 96) -> Frame:
    from room2dgs.geometry.camera import Camera

    K = np.array([[80.0, 0, width / 2], [0, 80.0, 36], [0, 0, 1]])
    return Frame(name, Camera(K, width, 72, np.eye(4) if pose is None else pose), Path(f"{name}.jpg"))


def test_each_photo_saw_its_own_points():
    index, pixel = cloud().tracks.of_frame("b")
    assert index.tolist() == [1, 2] and pixel.tolist() == [[7, 8], [9, 10]]
    assert len(cloud().tracks.of_frame("c")[0]) == 0
    assert cloud().track_length.tolist() == [1, 2, 1, 1]


def test_tracks_follow_the_points_that_stay():
    points = cloud().chosen(np.array([False, True, False, True]))
    assert points.xyz.tolist() == cloud().xyz[[1, 3]].tolist() and points.rgb[1].tolist() == [9, 10, 11]
    index, pixel = points.tracks.of_frame("a")
    assert index.tolist() == [0, 1] and pixel.tolist() == [[3, 4], [5, 6]]
    assert points.tracks.of_frame("b")[0].tolist() == [0]
    assert points.track_length.tolist() == [2, 1]
    bare = PointCloud(cloud().xyz, cloud().rgb).chosen(np.array([True, False, False, True]))
    assert len(bare) == 2 and bare.tracks is None


def test_tracks_decide_what_a_photo_sees():
    seen = seen_points(cloud(), photo("a"))
    assert seen.index.tolist() == [0, 1, 3]
    assert seen.pixel[0].tolist() == [1.5, 2.5] and seen.depth == pytest.approx([2.0, 2.0, 2.0])
    assert [part.tolist() for part in seen.column_row] == [[1, 3, 5], [2, 4, 6]]
    assert len(seen_points(cloud(), photo("c")).index) == 0
    # a point that is not in front of the photo, whatever the tracks say
    backwards = np.diag([-1.0, 1, -1, 1])
    assert len(seen_points(cloud(), photo("a", backwards)).index) == 0


def test_without_tracks_a_point_plainly_behind_another_one_is_not_seen():
    near, far = np.array([0.02, 0.02, 1.0]), np.array([0.04, 0.04, 2.0])  # in one cell
    beside, outside, behind = np.array([0.3, 0, 2.0]), np.array([3.0, 0, 2.0]), np.array([0, 0, -1.0])
    xyz = np.stack([far, near, beside, outside, behind, 1.2 * near])
    seen = probably_seen(xyz, photo("a").camera)
    assert seen.index.tolist() == [1, 2, 5]
    assert seen.pixel[0] == pytest.approx([49.6, 37.6]) and seen.depth == pytest.approx([1, 2, 1.2])
    assert seen_points(PointCloud(xyz, np.zeros((6, 3), np.uint8)), photo("a")).index.tolist() == [1, 2, 5]
    assert len(probably_seen(np.zeros((0, 3)), photo("a").camera).index) == 0


def test_what_a_photo_probably_sees_too_stands_behind_what_it_is_known_to_see():
    known = seen_points(cloud(), photo("a"))
    points, sure = likely_points(cloud(), photo("a"))
    assert sure.tolist() == [True] * len(known.index) + [False] * (len(points.index) - len(known.index))
    assert len(set(points.index.tolist())) == len(points.index)  # nothing twice
    np.testing.assert_array_equal(points.pixel[sure], known.pixel)  # where it was matched, not where it projects
    guess = probably_seen(cloud().xyz, photo("a").camera)
    assert set(points.index.tolist()) == set(known.index.tolist()) | set(guess.index.tolist())
    bare, all_sure = likely_points(PointCloud(cloud().xyz, cloud().rgb), photo("a"))
    assert all_sure.all() and bare.index.tolist() == guess.index.tolist()


def test_a_photo_that_is_known_to_have_seen_many_points_needs_no_guess(monkeypatch):
    monkeypatch.setattr("room2dgs.captures.seen_points.ENOUGH_TRACKED", 3)
    points, sure = likely_points(cloud(), photo("a"))
    assert points.index.tolist() == seen_points(cloud(), photo("a")).index.tolist() and sure.all()
