"""Which views depth is found of."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from room2dgs.captures.keyframes import LEAST_VIEWS, keyframes
from room2dgs.geometry.camera import Camera


def camera(centre, turn_deg=0.0) -> Camera:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("y", turn_deg, degrees=True).as_matrix()
    pose[:3, 3] = -pose[:3, :3] @ np.asarray(centre, float)
    return Camera(np.array([[50.0, 0, 32], [0, 50, 24], [0, 0, 1]]), 64, 48, pose)


@given(st.integers(1, 40), st.floats(0.01, 1), st.integers(0, 9))
def test_the_asked_share_is_taken_in_order_and_the_first_with_it(count, share, seed):
    rng = np.random.default_rng(seed)
    cameras = [camera(rng.normal(0, 1, 3), rng.uniform(0, 360)) for _ in range(count)]
    taken = keyframes(cameras, share)
    assert taken == sorted(set(taken)) and taken[0] == 0
    assert len(taken) == min(count, max(LEAST_VIEWS, int(np.ceil(share * count))))


def test_of_views_in_one_place_one_is_taken():
    cameras = [camera((i // 2, 0, 0)) for i in range(12)]
    assert {index // 2 for index in keyframes(cameras, 0.5)} == set(range(6))


def test_views_that_look_elsewhere_from_one_place_are_all_taken():
    """Eight directions from a tripod, and a walk of small steps and turns."""
    cameras = [camera((0, 0, 0), 45 * i) for i in range(8)] + [camera((0.05 * i, 0, 0), i) for i in range(1, 17)]
    assert set(range(8)) <= set(keyframes(cameras, 0.5))


def test_the_scale_of_the_scene_does_not_matter():
    rng = np.random.default_rng(3)
    places, turns = rng.normal(0, 1, (30, 3)), rng.uniform(0, 90, 30)
    both = [
        keyframes([camera(scale * place, turn) for place, turn in zip(places, turns, strict=True)], 0.4)
        for scale in (1, 1000)
    ]
    assert both[0] == both[1]


def test_cameras_that_are_all_the_same_still_give_as_many():
    assert len(keyframes([camera((0, 0, 0))] * 10, 0.5)) == 5
