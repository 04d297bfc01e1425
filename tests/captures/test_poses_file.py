"""poses.json of a run may be a stranger's: poses are rigid, and whatever else it holds is one sentence."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.captures.poses_file import KIND, read_poses, write_poses
from room2dgs.captures.scene import Frame, Scene
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import rigid_pose

K = np.array([[50.0, 0, 32], [0, 50, 24], [0, 0, 1]])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    frames = tuple(
        Frame(
            name, Camera(K, 64, 48, rigid_pose(np.eye(3), np.array([x, 0.0, 0]))), tmp_path_factory.mktemp(name) / "x"
        )
        for x, name in enumerate("ab")
    )
    return Scene("capture", frames, ())


@pytest.fixture
def saved(scene, tmp_path):
    write_poses(tmp_path / "poses.json", scene, scene, {})
    return tmp_path / "poses.json"


def refusal(path, scene) -> str:
    with pytest.raises(InputError) as caught:
        read_poses(path, scene)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    return str(caught.value)


def changed(path, place, value) -> None:
    content = json.loads(path.read_text())
    node = content
    for key in place[:-1]:
        node = node[key]
    node[place[-1]] = value
    path.write_text(json.dumps(content))


SHEAR = np.array([[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]).tolist()
MIRROR = np.diag([1.0, 1, -1, 1]).tolist()
REFINED = ("cam_from_world", "a", "refined")


@pytest.mark.parametrize("pose", [SHEAR, MIRROR, np.zeros((4, 4)).tolist(), (2 * np.eye(4)).tolist()])
def test_a_pose_that_is_not_rigid_is_named(saved, scene, pose):
    changed(saved, REFINED, pose)
    assert "gives a a pose that is not rigid; delete it" in refusal(saved, scene)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (REFINED, [[1, 0], [0, 1]]),
        (REFINED, "none"),
        (REFINED, [[1e300] * 4] * 4),
        (REFINED, [[float("nan")] * 4] * 4),
        (REFINED, [[10**400] * 4] * 4),
        (("cam_from_world", "a"), [1]),
        (("cam_from_world",), [1]),
        (("kind",), "poses of another program"),
        (("kind",), [KIND]),
        (("report",), 5),
        (("report",), {"left_out": 5}),
        (("report",), {"left_out": [["a"]]}),
        (("report",), {"lens": {"model": "PINHOLE", "params": ["a"], "size": [64, 48]}}),
        (("report",), {"lens": {"model": "PINHOLE", "params": [50, 50, 32, 24], "size": [64]}}),
        (("report",), {"lens": {"model": "PINHOLE", "params": [50, 50, 32, 24], "size": [1e400, 48]}}),
        (("report",), {"lens": [1, 2]}),
    ],
)
def test_what_is_no_file_of_poses_is_told(saved, scene, place, value):
    changed(saved, place, value)
    assert "is not a file of refined poses; delete it" in refusal(saved, scene)


def test_a_file_that_leaves_out_every_photo_is_told(saved, scene):
    changed(saved, ("report",), {"left_out": ["a", "b"]})
    assert "leaves out every training photo" in refusal(saved, scene)
    changed(saved, ("report",), {"left_out": ["a"]})
    assert [frame.name for frame in read_poses(saved, scene)[0].train] == ["b"]


def test_other_files_are_told_at_once(saved, scene):
    saved.write_text("[" * 1_000_000)
    assert "is not a file of refined poses" in refusal(saved, scene)
    with saved.open("wb") as file:
        file.truncate(1 << 40)
    assert "too large" in refusal(saved, scene)
    saved.unlink()
    os.mkfifo(saved)
    assert "is a pipe" in refusal(saved, scene)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(("model", "size", "a")), inner),
    max_leaves=8,
)
PLACES = [("kind",), ("report",), ("cam_from_world",), ("cam_from_world", "a"), REFINED, (*REFINED[:2], "given")]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.sampled_from([*PLACES, ("report", "left_out"), ("report", "lens")]), value=JSON)
def test_any_other_value_is_one_sentence_or_changes_no_pose(scene, tmp_path, place, value):
    path = tmp_path / "poses.json"
    write_poses(path, scene, scene, {"left_out": [], "lens": None})
    changed(path, place, value)
    try:
        found = read_poses(path, scene)[0]
    except InputError:
        return
    by_name = {frame.name: frame for frame in scene.frames}
    for frame in found.frames:
        assert np.array_equal(frame.camera.cam_from_world, by_name[frame.name].camera.cam_from_world)
