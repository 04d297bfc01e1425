"""Which places stereo matched: by the view that shows a place and knows most, and by no view that it is hidden from."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.bench.matched_surface import matched_views
from room2dgs.geometry.camera import Camera
from room2dgs.runs.trust import Trust

SIZE = 40, 30


class Named:
    """What `matched_views` asks of a frame."""

    def __init__(self, name: str, x: float) -> None:
        pose = np.eye(4)
        pose[0, 3] = -x
        self.name, self.camera = name, Camera(np.array([[160.0, 0, 80], [0, 160, 60], [0, 0, 1]]), 160, 120, pose)


def flat(count: int, z: float = 2.0) -> Trust:
    """A wall straight ahead, of which the left half was matched in `count` views."""
    matched = np.zeros(SIZE[::-1], np.uint8)
    matched[:, :20] = count
    return Trust(np.full(matched.shape, 255, np.uint8), matched, np.full(matched.shape, z, np.float16))


@pytest.fixture
def frames():
    return [Named("a", 0.0), Named("b", 0.5)]


def test_the_view_that_knows_most_tells(frames):
    points = np.array([[-0.5, 0.0, 2.0], [0.2, 0.0, 2.0], [0.9, 0.0, 2.0], [9.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    found = matched_views(points, frames, {"a": flat(2), "b": flat(5)})
    # left of a's middle and of b's; of b's alone; right of both; in no picture; behind both
    assert list(found.views) == [5, 5, 0, 0, 0]
    assert list(matched_views(points, frames, {"a": flat(5), "b": flat(2)}).views) == [5, 2, 0, 0, 0]  # in either order
    assert list(matched_views(points, frames, {"a": flat(2)}).views) == [2, 0, 0, 0, 0]


def test_a_place_that_a_view_does_not_show_is_not_told_by_it(frames):
    hidden = np.array([[-0.2, 0.0, 2.3]])  # a foot behind the wall
    assert list(matched_views(hidden, frames, {"a": flat(7)}).views) == [0]
    assert list(matched_views(hidden, frames, {"a": flat(7, z=2.3)}).views) == [7]


def test_views_without_depth_tell_nothing(frames):
    bare = flat(4)._replace(depth=None)
    empty = flat(4, z=0.0)
    points = np.array([[-0.2, 0.0, 2.0]])
    assert list(matched_views(points, frames, {"a": bare, "b": empty}).views) == [0]


def test_a_place_lies_on_a_plane_where_a_view_has_it_there(frames):
    points = np.array([[-0.5, 0.0, 2.0], [0.9, 0.0, 2.0], [9.0, 0.0, 2.0]])
    on_plane = np.zeros(SIZE[::-1], np.uint8)
    on_plane[:, 20:] = 1
    found = matched_views(points, frames, {"a": flat(2)._replace(on_plane=on_plane), "b": flat(2)})
    assert found.on_plane.tolist() == [False, True, False]
    assert not matched_views(points, frames, {"a": flat(2), "b": flat(2)}).on_plane.any()
