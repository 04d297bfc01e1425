"""What photos show of a wall's plane, and of which true openings they show the rim."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from room2dgs.bench.openings_seen import sides_seen
from room2dgs.bench.plan_truth import PlanTruth, TrueOpening, TrueWall
from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import Camera
from room2dgs.plan.wall_picture import look_of
from room2dgs.runs.trust import Trust

AWAY = 2.0  # metres from the cameras to the wall y = 0
WALL = TrueWall(np.array([0.0, 0]), np.array([4.0, 0]), 0)  # its room lies at y > 0
TOWARDS = np.array([0.0, 1, 0])
K = np.array([[80.0, 0, 80], [0, 80, 60], [0, 0, 1]])


class Photo(Frame):
    """Left of x = 2 m it shows a black wall, right of it a white one, 1.2 m from the floor up and down."""

    def depth(self) -> np.ndarray:
        """Something stands half a metre before the wall right of x = 3 m."""
        return np.where(self._x > 3.0, AWAY - 0.5, AWAY).astype(np.float32)

    def levelled_color(self) -> np.ndarray:
        return np.repeat(np.where(self._x > 2.0, 255, 0).astype(np.uint8)[..., None], 3, axis=2)

    @property
    def _x(self) -> np.ndarray:
        return self.camera.unproject_map(np.full((120, 160), AWAY))[..., 0]


def photo(x: float) -> Photo:
    """From x, 1.2 m above the floor, straight at the wall; image x runs along the world's -x."""
    rotation = np.array([[-1.0, 0, 0], [0, 0, -1], [0, -1, 0]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ np.array([x, AWAY, 1.2])
    return Photo(f"at {x}", Camera(K, 160, 120, pose), Path("none.png"))


def opening(start: float, end: float) -> TrueOpening:
    return TrueOpening("window", WALL, start, end, 0.9, 1.5, True)


@pytest.mark.parametrize(
    ("start", "end", "xs", "share"),
    [
        (1.0, 2.0, (1.5, 2.0), 1.0),
        (1.0, 2.0, (1.5,), 0.0),  # one photo is not enough
        (2.2, 3.3, (2.0, 2.5), 0.75),  # the right side is hidden
        (3.2, 3.9, (2.0, 2.5), 0.0),
        (6.0, 7.0, (1.5, 2.0), 0.0),  # out of sight
    ],
)
def test_a_side_of_a_rim_is_seen_where_two_photos_show_half_of_it(start, end, xs, share):
    truth = PlanTruth((), (), (WALL,), (opening(start, end),), ())
    assert sides_seen(truth, [photo(x) for x in xs]) == [share]


def test_a_wall_is_not_seen_from_behind():
    behind = TrueWall(WALL.end, WALL.start, 1)
    one = TrueOpening("door", behind, 2.0, 3.0, 0.0, 1.5, True)
    assert sides_seen(PlanTruth((), (), (behind,), (one,), ()), [photo(1.5), photo(2.0)]) == [0.0]


def test_without_true_depth_all_is_taken_as_seen():
    frame = Frame("x", photo(1.5).camera, Path("none.png"))
    assert sides_seen(PlanTruth((), (), (WALL,), (opening(1, 2),), ()), [frame]) == [1.0]


def test_a_wall_shows_its_colours_where_nothing_hides_it():
    frames = [photo(1.5), photo(2.5)]
    maps = {
        frame.name: Trust(*(np.full((60, 80), 255, np.uint8) for _ in range(2)), frame.depth()[::2, ::2])
        for frame in frames
    }
    turn = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # level_from_world
    points = np.array([[1.0, 0, 1.2], [2.4, 0, 1.0], [3.3, 0, 1.2], [9.0, 0, 1.2]])
    seen = look_of(frames, maps, turn)(points @ turn.T, turn @ TOWARDS)
    assert seen.known.tolist() == [True, True, False, False]
    np.testing.assert_allclose(seen.color[:2].mean(axis=1), [0, 1], atol=1e-6)
    assert not look_of(frames, maps, turn)(points @ turn.T, -turn @ TOWARDS).known.any()
