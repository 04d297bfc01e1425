"""Pairs to match, from poses alone."""

from __future__ import annotations

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import shared_view
from room2dgs.sfm.pairs import match_pairs

K = np.array([[260.0, 0, 160], [0, 260.0, 120], [0, 0, 1]])


def camera(x: float, turn_deg: float = 0.0) -> Camera:
    """At (x, 0, 0), turned about the vertical."""
    angle = np.radians(turn_deg)
    world_from_cam = np.eye(4)
    world_from_cam[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)],
        [0, 1, 0],
        [-np.sin(angle), 0, np.cos(angle)],
    ]
    world_from_cam[0, 3] = x
    return Camera(K, 320, 240, np.linalg.inv(world_from_cam))


def test_views_back_to_back_share_nothing_and_neighbours_do():
    score = shared_view([camera(0.0), camera(0.2), camera(0.2, 180.0)])
    np.testing.assert_array_equal(score, score.T)
    assert score[0, 1] > 0.5
    assert score[0, 2] == score[1, 2] == 0.0


def test_without_a_baseline_nothing_can_be_triangulated():
    views = [camera(0.0), camera(0.0), camera(0.0, 5.0)]
    assert shared_view(views).max() < 1e-6
    assert match_pairs(views, overlap=4) == []


def test_a_loop_is_closed_between_its_ends():
    """Sixteen views turn away and come back: first and last see the same wall, far apart in the sequence."""
    turns = [*np.linspace(0, 150, 8), *np.linspace(150, 0, 8)]
    views = [camera(0.02 * i, turn) for i, turn in enumerate(turns)]
    assert (0, 15) in match_pairs(views, overlap=4)


def test_every_pair_once_and_no_more_than_overlap_a_frame():
    views = [camera(0.05 * i) for i in range(20)]
    pairs = match_pairs(views, overlap=6)
    assert pairs == sorted(set(pairs)) and all(i < j for i, j in pairs)
    assert {(i, i + 1) for i in range(19)} <= set(pairs)
    assert len(pairs) <= 20 * 6
