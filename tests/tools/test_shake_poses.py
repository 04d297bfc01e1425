"""Shaken poses have the asked errors; all else is the capture's."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.captures.matrix_files import read_world_from_cam
from room2dgs.captures.poses_file import write_poses
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
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
