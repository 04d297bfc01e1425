"""Views that no track tells of are corrected as their neighbours are, where corrections are alike, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import pose_at
from room2dgs.sfm.bundle import moves
from room2dgs.sfm.propagated import propagated

K = np.array([[260.0, 0, 160], [0, 255.0, 118], [0, 0, 1]])


def walk(count: int = 60) -> list[Camera]:
    turns = Rotation.from_rotvec(np.linspace(0, 3.5, count)[:, None] * [0.0, 1.0, 0.0]).as_matrix()
    return [
        Camera(K, 320, 240, pose_at(turn, np.array([0.1 * index, np.sin(index / 9), 0])))
        for index, turn in enumerate(turns)
    ]


def off_by(cameras, turns: np.ndarray, shifts: np.ndarray) -> list[Camera]:
    """Each turned about its centre, in the world's axes, and shifted."""
    return [
        replace(one, cam_from_world=pose_at(one.rotation @ Rotation.from_rotvec(turn).as_matrix(), one.centre + shift))
        for one, turn, shift in zip(cameras, turns, shifts, strict=True)
    ]


def drift(count: int, smooth: bool, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    random, along = np.random.default_rng(seed), np.arange(count)
    if not smooth:
        return 0.008 * random.normal(size=(count, 3)), 0.01 * random.normal(size=(count, 3))
    wave = np.stack([np.sin(along / 15 + phase) for phase in random.uniform(0, 6, 6)], axis=1)
    return 0.01 * wave[:, :3], 0.02 * wave[:, 3:]


def test_what_drifts_is_corrected_and_what_jitters_is_left():
    true = walk()
    known = np.ones(60, bool)
    known[[0, 20, 21, 22, 23, 24, 40, 59]] = False
    for smooth in (True, False):
        given = off_by(true, *drift(60, smooth))
        found = propagated(
            [one if sure else other for one, other, sure in zip(true, given, known, strict=True)], given, known
        )
        before, after = (moves(some, true) for some in (given, found.cameras))
        assert max(after[0][known].max(), after[1][known].max()) < 1e-9 and (found.remaining[known] == 0).all()
        if smooth:
            assert (after[0][~known] < 0.25 * before[0][~known].max()).all()
            assert (after[1][~known] < 0.25 * before[1][~known].max()).all() and (found.remaining < 0.3).all()
        else:
            assert after[0][~known].mean() < 1.1 * before[0][~known].mean()
            assert after[1][~known].mean() < 1.1 * before[1][~known].mean() and (found.remaining[~known] > 0.9).all()


def test_few_known_views_tell_nothing():
    true = walk(9)
    given = off_by(true, *drift(9, True))
    known = np.arange(9) != 4
    mixed = [one if sure else other for one, other, sure in zip(true, given, known, strict=True)]
    found = propagated(mixed, given, known)
    assert found.cameras[4] is given[4] and found.remaining[4] == 1
    assert (propagated(given, given, np.zeros(9, bool)).remaining == 1).all()
