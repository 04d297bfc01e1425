"""Scale from the ways between cameras: drift, jumps, similarity, and where ways tell nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given as cases
from hypothesis import settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose, pose_at
from room2dgs.sfm.bundle import aligned
from room2dgs.sfm.motion_scale import common_scale, motion_scale, regression
from room2dgs.tools.pose_drift import Drift, drifted

K = np.array([[260.0, 0, 160], [0, 255.0, 118], [0, 0, 1]])


def walk(count: int = 140, reach: float = 1.0) -> list[Camera]:
    """1.5 m along a counter while the camera sways and looks around: 6 m on its way."""
    cameras = []
    for t in np.linspace(0, 15, count):
        centre = reach * np.array([0.1 * t, 0.25 * np.sin(2 * t), 0.1 * np.sin(3.1 * t)])
        turn = Rotation.from_euler("zyx", (0.9 * np.sin(t), 0.2, 0.1)).as_matrix()
        cameras.append(Camera(K, 320, 240, pose_at(turn, centre)))
    return cameras


def moved(cameras, turn, shift, scale: float) -> list[Camera]:
    """By a similarity."""
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return [
        replace(c, cam_from_world=pose_at(c.rotation @ rotation.T, scale * rotation @ c.centre + shift))
        for c in cameras
    ]


def tracked(cameras, seed: int, drift: Drift = Drift()) -> list[Camera]:  # noqa: B008
    poses, _ = drifted(np.stack([c.world_from_cam for c in cameras]), drift, np.random.default_rng(seed))
    return [replace(c, cam_from_world=inverse_pose(pose)) for c, pose in zip(cameras, poses, strict=True)]


def by_centres(cameras, given) -> float:
    """The plain regression of given centres on found ones."""
    want, found = (np.stack([c.centre for c in some]) for some in (given, cameras))
    want, found = want - want.mean(axis=0), found - found.mean(axis=0)
    return float(np.sum(want * found) / np.sum(found**2))


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@cases(
    st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3),
    st.lists(st.floats(-9, 9), min_size=3, max_size=3),
    st.floats(0.92, 1.08),
)
@settings(max_examples=20)
def test_of_a_similarity_the_scale_comes_back_exactly(turn, shift, scale):
    true = walk(40)
    back = aligned(moved(true, turn, shift, scale), true, np.ones(40, bool))
    assert back.scale == pytest.approx(1 / scale, rel=1e-9)


def test_a_trackers_drift_takes_less_of_the_scale_than_of_the_extent():
    true = walk()
    given = [tracked(true, seed) for seed in range(16)]
    extent = rms([by_centres(true, one) - 1 for one in given])
    assert rms([motion_scale(true, one).scale - 1 for one in given]) < 0.3 * extent
    assert rms([common_scale(true, one) - 1 for one in given]) < 0.65 * extent


def test_independent_errors_take_no_more_than_they_do_from_the_extent():
    true, random = walk(), np.random.default_rng(2)
    given = [
        [replace(c, cam_from_world=pose_at(c.rotation, c.centre + random.normal(0, 0.01, 3))) for c in true]
        for _ in range(16)
    ]
    extent = rms([by_centres(true, one) - 1 for one in given])
    assert rms([motion_scale(true, one).scale - 1 for one in given]) > 1.5 * extent  # else the case is not hard
    assert rms([common_scale(true, one) - 1 for one in given]) < 1.15 * extent


def test_a_relocalisation_does_not_change_the_scale():
    true = walk()
    given = [
        *(replace(c, cam_from_world=pose_at(c.rotation, c.centre + np.array([0.1, 0, 0]))) for c in true[:70]),
        *true[70:],
    ]
    assert motion_scale(true, given).scale == pytest.approx(1, abs=2e-3)
    assert abs(by_centres(true, given) - 1) > 0.02  # else the case is not hard
    assert common_scale(true, given) == pytest.approx(1, abs=5e-3)


def test_what_a_regression_says_of_its_error_is_what_it_is():
    random = np.random.default_rng(4)
    for alike in (0.0, 0.8):
        scales, said = [], []
        for _ in range(200):
            found = np.cumsum(random.normal(0, 0.3, (150, 3)), axis=0) / 5 + 1.0
            noise = random.normal(0, 0.02, (150, 3))
            for row in range(1, 150):
                noise[row] = alike * noise[row - 1] + np.sqrt(1 - alike**2) * noise[row]
            one = regression(1.1 * found + noise, found)
            scales.append(one.scale - 1.1)
            said.append(one.variance)
        assert np.sqrt(np.median(said)) == pytest.approx(rms(scales), rel=0.3)


def test_few_cameras_and_cameras_in_one_place():
    assert motion_scale(walk()[:5], walk()[:5]) is None
    assert motion_scale(walk(reach=0.01), walk(reach=0.01)) is None  # nobody walked half a metre
    one_place = [replace(c, cam_from_world=pose_at(c.rotation, np.zeros(3))) for c in walk()]
    assert motion_scale(one_place, walk()) is None
    assert common_scale(one_place, walk()) == 1.0
    assert common_scale(walk()[:3], walk()[:3]) == pytest.approx(1, abs=1e-12)
