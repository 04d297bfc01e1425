"""Pose and intrinsics files: what is read back, what is repaired, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from room2dgs.captures.matrix_files import NonFinitePose, read_intrinsics, read_world_from_cam
from room2dgs.errors import InputError

SAME_FOLDER = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
GAPS = st.lists(st.text(alphabet=" \t\n\r", min_size=1, max_size=4), min_size=17, max_size=17)
COORDINATES = st.floats(-100.0, 100.0, allow_nan=False)


def spaced(numbers: np.ndarray, gaps: list[str]) -> str:
    return gaps[-1] + "".join(f"{number!r}{gap}" for number, gap in zip(numbers.tolist(), gaps, strict=False))


def rigid(rotation_vector=(0.3, -1.2, 0.5), translation=(1.0, -2.0, 0.25)) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(rotation_vector).as_matrix()
    pose[:3, 3] = translation
    return pose


@SAME_FOLDER
@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[COORDINATES] * 3), GAPS)
def test_a_pose_survives_any_white_space(tmp_path, rotation_vector, translation, gaps):
    pose = rigid(rotation_vector, translation)
    path = tmp_path / "0.txt"
    path.write_text(spaced(pose.ravel(), gaps), newline="")
    read = read_world_from_cam(path)
    np.testing.assert_allclose(read, pose, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(read[:3, 3], pose[:3, 3])


@SAME_FOLDER
@given(st.floats(1.0, 5e3), st.floats(1.0, 5e3), COORDINATES, COORDINATES, st.sampled_from([3, 4]), GAPS)
def test_intrinsics_survive_as_3x3_and_as_4x4(tmp_path, fx, fy, cx, cy, size, gaps):
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    matrix = np.eye(size)
    matrix[:3, :3] = K
    path = tmp_path / "intrinsic_color.txt"
    path.write_text(spaced(matrix.ravel(), gaps), newline="")
    np.testing.assert_array_equal(read_intrinsics(path), K)


@SAME_FOLDER
@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_a_rotation_rounded_to_three_decimals_is_made_rigid_again(tmp_path, rotation_vector):
    pose = rigid(rotation_vector)
    path = tmp_path / "0.txt"
    np.savetxt(path, pose, fmt="%.3f")
    read = read_world_from_cam(path)
    np.testing.assert_allclose(read[:3, :3].T @ read[:3, :3], np.eye(3), atol=1e-14)
    assert np.linalg.det(read[:3, :3]) > 0
    np.testing.assert_allclose(read[:3, :3], pose[:3, :3], atol=2e-3)


@pytest.mark.parametrize("value", ["inf", "-inf", "nan", "NaN"])
def test_a_pose_of_inf_or_nan_is_lost_tracking_not_bad_input(tmp_path, value):
    path = tmp_path / "12.txt"
    path.write_text(" ".join([value] * 16))
    with pytest.raises(NonFinitePose, match=r"12\.txt"):
        read_world_from_cam(path)


def scaled(pose):
    pose[:3, :3] *= 1.01


def mirrored(pose):
    pose[:3, 0] *= -1


def sheared(pose):
    pose[:3, 0] += 0.1 * pose[:3, 1]


def transposed(pose):
    pose[:] = pose.T.copy()


def zero(pose):
    pose[:] = 0


@pytest.mark.parametrize("spoil", [scaled, mirrored, sheared, transposed, zero])
def test_a_pose_that_is_not_rigid_is_refused_by_name(tmp_path, spoil):
    pose = rigid()
    spoil(pose)
    path = tmp_path / "7.txt"
    np.savetxt(path, pose)
    with pytest.raises(InputError, match=r"7\.txt is not a rigid pose"):
        read_world_from_cam(path)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "holds 0 numbers"),
        (b"1 0 0 0 0 1 0 0 0 0 1 0", "holds 12 numbers"),
        (b"1 " * 17, "holds 17 numbers"),
        (b"1 0 0 zero " * 4, "no number"),
        (b"\xff\xfe\x00\x01", "no number"),
    ],
)
def test_a_malformed_pose_file_is_refused_by_name(tmp_path, content, problem):
    path = tmp_path / "3.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"3\.txt.*{problem}"):
        read_world_from_cam(path)


def test_a_missing_or_unreadable_file_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"4\.txt is missing"):
        read_world_from_cam(tmp_path / "4.txt")
    (tmp_path / "5.txt").mkdir()
    with pytest.raises(InputError, match=r"5\.txt is a folder where a file belongs"):
        read_world_from_cam(tmp_path / "5.txt")


@pytest.mark.parametrize(
    ("row", "column", "value"),
    [(0, 0, -500.0), (1, 1, 0.0), (0, 2, np.nan), (0, 1, 3.0), (2, 2, 2.0), (2, 0, 1.0)],
)
def test_intrinsics_that_are_no_pinhole_camera_are_refused_by_name(tmp_path, row, column, value):
    K = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])
    K[row, column] = value
    path = tmp_path / "intrinsic_color.txt"
    np.savetxt(path, K)
    with pytest.raises(InputError, match=r"intrinsic_color\.txt"):
        read_intrinsics(path)
