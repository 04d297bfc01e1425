"""A made room filmed by a phone: the truth stays exact, and motion does to photos what it should."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest

from room2dgs.tools.make_captures import CaptureOptions, make_capture
from room2dgs.tools.phone_camera.effects import OF_WALK
from room2dgs.tools.phone_camera.filming import filming
from room2dgs.tools.phone_camera.motion import PHOTO_S, Motion, blur_px, motions, moving_photo
from tests.oracles.made_captures import read_capture

STILL = Motion(np.zeros(3), np.zeros(3))
PANNING = Motion(np.zeros(3), np.array([0, 1.0, 0]))  # a radian a second to the right
FOCAL, SIZE = 100.0, (120, 90)


def half_bright(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Light of everything to the right of the plane x = 0."""
    return np.repeat((directions[:, :1] > 0).astype(np.float32), 3, axis=1)


def edges(photo: np.ndarray) -> np.ndarray:
    """(H,) column of the edge between dark and bright in each row."""
    return photo.shape[1] - photo[..., 0].sum(axis=1)


shot = partial(moving_photo, half_bright, FOCAL, np.eye(4))


def test_a_camera_that_stands_still_takes_the_same_photo_whatever_the_shutter():
    photo = shot(STILL, SIZE, 0.0, 0.0)
    assert np.array_equal(photo, shot(STILL, SIZE, 0.03, 0.02))
    assert edges(photo) == pytest.approx(60, abs=0.3)


def test_a_rolling_shutter_slants_what_is_upright():
    edge = edges(shot(PANNING, SIZE, 0.0, 0.02))
    # 0.02 s of a radian a second, at a focal length of 100 pixels; the middle row has the given pose
    assert edge[0] - edge[-1] == pytest.approx(2.0, abs=0.3)
    assert edge[45] == pytest.approx(60, abs=0.3)
    assert np.ptp(edges(shot(PANNING, SIZE, 0.0, 0.0))) < 1e-3


def test_motion_in_the_exposure_blurs_along_its_way():
    photo = shot(PANNING, SIZE, 0.06, 0.0)
    between = (photo[45, :, 0] > 0.01) & (photo[45, :, 0] < 0.99)
    assert blur_px(PANNING, FOCAL, 0.06) == pytest.approx(6)
    assert 5 <= between.sum() <= 8
    assert edges(photo)[45] == pytest.approx(60, abs=0.4)


def test_a_cameras_motion_is_that_from_photo_to_photo():
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = 0, 0.1, 0.2
    found = motions(poses, np.random.default_rng(0))
    for one in found:
        assert one.velocity == pytest.approx([0.1 / PHOTO_S, 0, 0])
    assert 0 < np.linalg.norm([one.turning for one in found], axis=1).max() < 0.2


@pytest.mark.parametrize("effect", OF_WALK)
def test_each_effect_of_a_walk_changes_its_own_part_alone(effect):
    poses = np.tile(np.eye(4), (12, 1, 1))
    poses[:, 0, 3] = 0.1 * np.arange(12)
    plain = filming(frozenset(), poses, np.random.default_rng(1))
    one = filming(frozenset({effect}), poses, np.random.default_rng(1))
    parts = {"wander": "gains", "breathing": "focal", "blur": "exposure_s", "drift": "written"}
    for name, part in parts.items():
        same = np.array_equal(getattr(plain, part), getattr(one, part))
        assert same == (name != effect)
    both = filming(frozenset({effect, "breathing", "wander"}), poses, np.random.default_rng(1))
    if effect in parts:
        assert np.array_equal(getattr(both, parts[effect]), getattr(one, parts[effect]))
    assert np.abs(filming(frozenset({"breathing"}), poses, np.random.default_rng(1)).focal - 1).max() <= 0.01 + 1e-9


def test_a_phones_capture_has_the_truth_of_the_plain_one_and_the_same_bytes_again(films, tmp_path):
    options = CaptureOptions(seed=77, photos=6, width=80, height=60, phone="all")
    path = make_capture(tmp_path / "phone", 0, options)
    plain, phone = films[0], read_capture(path)
    assert np.array_equal(phone.depths, plain.depths)
    assert (path / "gt_mesh.ply").read_bytes() == (plain.path / "gt_mesh.ply").read_bytes()
    assert np.abs(np.stack(phone.colors).astype(int) - np.stack(plain.colors)).mean() > 3
    assert not np.allclose(phone.poses, plain.poses)  # drift
    for index in range(6):
        assert (path / f"pose_true/{index}.txt").read_bytes() == (plain.path / f"pose/{index}.txt").read_bytes()
    assert len(json.loads((path / "phone.json").read_text())["gains"]) == 6
    again = make_capture(tmp_path / "again", 0, options)
    for file in sorted(path.rglob("*.*")):
        assert (again / file.relative_to(path)).read_bytes() == file.read_bytes()
    assert make_capture(path, 0, options) == path  # kept
