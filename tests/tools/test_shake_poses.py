"""Shaken poses have the asked errors; all else is the capture's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.captures.matrix_files import read_world_from_cam
from room2dgs.captures.poses_file import write_poses
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.tools.pose_drift import AFTER_CM, SMOOTH_M, Drift, drifted
from room2dgs.tools.pose_errors import main as tool
from room2dgs.tools.pose_errors import pose_errors
from room2dgs.tools.shake_poses import main, shake_poses


def poses(folder, names) -> np.ndarray:
    return np.stack([read_world_from_cam(folder / f"pose/{name}.txt") for name in names])


def test_errors_have_the_asked_sizes_and_photos_are_the_same(capture, tmp_path):
    for index in range(200):  # enough to measure the noise by
        (capture / f"pose/{index}.txt").write_text((capture / "pose/0.txt").read_text())
    lost = "-inf " * 16
    (capture / "pose/200.txt").write_text(lost)
    shake_poses(capture, tmp_path / "out", degrees=2.0, cm=3.0, seed=1)
    true, shaken = poses(capture, range(200)), poses(tmp_path / "out", range(200))
    ways = np.linalg.norm(shaken[:, :3, 3] - true[:, :3, 3], axis=1)
    turns = np.einsum("nij,nkj->nik", shaken[:, :3, :3], true[:, :3, :3])
    angles = np.degrees(np.arccos(((np.trace(turns, axis1=1, axis2=2) - 1) / 2).clip(-1, 1)))
    assert np.sqrt(np.mean(ways**2)) == pytest.approx(0.03, rel=0.15)
    assert np.sqrt(np.mean(angles**2)) == pytest.approx(2.0, rel=0.15)
    assert np.abs((shaken - true)[:, :3, 3].mean(axis=0)).max() < 0.005
    assert (tmp_path / "out/pose/200.txt").read_text() == lost
    assert (tmp_path / "out/color/0.jpg").read_bytes() == (capture / "color/0.jpg").read_bytes()
    shake_poses(capture, tmp_path / "same", degrees=2.0, cm=3.0, seed=1)
    np.testing.assert_array_equal(poses(tmp_path / "same", range(200)), shaken)


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["nowhere", "new"], "nowhere has no pose/*.txt"),
        (["CAPTURE", "new", "--cm", "-1"], "is impossible; give numbers of 0 or more"),
        (["CAPTURE", "CAPTURE"], "is there already"),
    ],
)
def test_bad_input_is_one_sentence(capture, tmp_path, monkeypatch, capsys, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    assert main([text.replace("CAPTURE", str(capture)) for text in arguments]) == 2
    said = capsys.readouterr().err
    assert sentence in said and said.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_errors_of_a_runs_poses_are_measured_against_the_true_ones(capture, tmp_path, capsys):
    shake_poses(capture, tmp_path / "out", degrees=0.8, cm=1.5, seed=1)
    scenes = [
        read_scene(load_config([f"scene.path={path}", "out=unused"]).scene) for path in (tmp_path / "out", capture)
    ]
    (tmp_path / "run").mkdir()
    write_poses(tmp_path / "run/poses.json", *scenes, {})
    found = pose_errors(capture, tmp_path / "run")
    assert found["refined"][0].max() < 1e-6 and found["refined"][1].max() < 1e-5
    metres = [
        np.linalg.norm(a.camera.centre - b.camera.centre) for a, b in zip(*(s.frames for s in scenes), strict=True)
    ]
    np.testing.assert_allclose(found["given"][0], metres, atol=1e-7)
    assert 0.3 < found["given"][1].mean() < 1.3
    write_poses(tmp_path / "run/poses.json", *scenes, {"left_out": [scenes[0].frames[1].name]})
    np.testing.assert_allclose(pose_errors(capture, tmp_path / "run")["given"][0], np.delete(metres, 1), atol=1e-7)
    assert tool([str(capture), str(tmp_path / "run")]) == 0
    assert "run, refined: 0.00 cm, 0.000 deg" in capsys.readouterr().out
    assert tool([str(capture), str(tmp_path)]) == 2
    assert "poses.json is missing" in capsys.readouterr().err


def walk(count: int, step_m: float) -> np.ndarray:
    """(N, 4, 4) poses along a circle, turned with it."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    angle = np.arange(count) * 0.02
    radius = step_m / (2 * np.sin(0.01))
    poses[:, 0, 3], poses[:, 2, 3] = radius * np.cos(angle), radius * np.sin(angle)
    poses[:, 0, 0] = poses[:, 2, 2] = np.cos(angle)
    poses[:, 2, 0], poses[:, 0, 2] = np.sin(angle), -np.sin(angle)
    return poses


def errors_of_motion(true: np.ndarray, wrong: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Metres and degrees by which the motion from each photo to the next is wrong: (N - 1, 3) and (N - 1,)."""
    motion, other = (np.linalg.inv(poses[:-1]) @ poses[1:] for poses in (true, wrong))
    error = np.linalg.inv(motion) @ other
    return error[:, :3, 3], np.degrees(Rotation.from_matrix(error[:, :3, :3]).magnitude())


def test_drift_has_the_asked_size_for_each_metre_and_is_smooth():
    true = walk(20_000, 0.05)
    drift = Drift(cm_per_m=2.0, degrees_per_m=0.35, relocalise_m=np.inf)
    wrong, jumps = drifted(true, drift, np.random.default_rng(0))
    metres, degrees = errors_of_motion(true, wrong)
    assert not jumps.any()
    np.testing.assert_array_equal(wrong[0], true[0])
    assert np.sqrt((metres**2).sum(axis=1).mean()) / 0.05 == pytest.approx(0.02, rel=0.1)
    assert np.sqrt((degrees**2).mean()) / 0.05 == pytest.approx(0.35, rel=0.1)
    alike = (metres[1:] * metres[:-1]).sum() / (metres**2).sum()  # 0 for white noise
    assert alike == pytest.approx(np.exp(-0.05 / SMOOTH_M), abs=0.01)
    far = round(5 * SMOOTH_M / 0.05)
    assert abs((metres[far:] * metres[:-far]).sum() / (metres**2).sum()) < 0.15


def test_drift_jumps_back_at_relocalisations():
    true = walk(4000, 0.05)  # 200 m
    drift = Drift(cm_per_m=2.0, degrees_per_m=0.35, relocalise_m=4.0)
    wrong, jumps = drifted(true, drift, np.random.default_rng(1))
    assert 30 < jumps.sum() < 75  # 50 are due
    off = np.linalg.norm((wrong - true)[:, :3, 3], axis=1)
    assert np.sqrt((off[jumps] ** 2).mean()) == pytest.approx(0.01 * AFTER_CM, rel=0.3)
    before = off[np.flatnonzero(jumps) - 1]
    assert before.mean() > 2 * off[jumps].mean()
    metres, _ = errors_of_motion(true, wrong)
    steps = np.linalg.norm(metres, axis=1)
    assert steps[jumps[1:]].mean() > 10 * steps[~jumps[1:]].mean()


def test_a_camera_that_stands_still_does_not_drift():
    true = np.tile(walk(1, 0.05), (50, 1, 1))
    wrong, _ = drifted(true, Drift(), np.random.default_rng(0))
    np.testing.assert_array_equal(wrong, true)


def test_drift_from_the_command_line(capture, tmp_path, capsys):
    assert main([str(capture), str(tmp_path / "one"), "--drift", "--seed", "3"]) == 0
    assert main([str(capture), str(tmp_path / "same"), "--drift", "--seed", "3"]) == 0
    assert main([str(capture), str(tmp_path / "other"), "--drift", "--seed", "4"]) == 0
    names = sorted(path.stem for path in (capture / "pose").glob("*.txt"))
    names.sort(key=int)
    true = poses(capture, names)
    one, same, other = (poses(tmp_path / name, names) for name in ("one", "same", "other"))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 1e-6
    np.testing.assert_allclose(one[0], true[0], atol=1e-9)
    assert np.abs(one - true).max() > 1e-5
    assert (tmp_path / "one/color/0.jpg").read_bytes() == (capture / "color/0.jpg").read_bytes()
    assert main([str(capture), str(tmp_path / "bad"), "--drift", "--cm-per-m", "-1"]) == 2
    assert main([str(capture), str(tmp_path / "bad"), "--drift", "--relocalise-m", "0"]) == 2
    assert "metres above 0 between relocalisations" in capsys.readouterr().err
    assert not (tmp_path / "bad").exists()
