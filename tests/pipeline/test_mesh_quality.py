"""Tears and coverage of a mesh without a ground truth: by the capture's depth, or by what the run trusts."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.captures.read import read_scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import load_config
from room2dgs.eval.mesh_quality import measure
from room2dgs.pipeline.mesh_quality import known_views
from room2dgs.runs.trust import read_trust, write_trust

WALL_Z = 2.0


@pytest.fixture
def scene(wall):
    return read_scene(load_config([f"scene.path={wall}", "out=x"]).scene)


def trusted(folder, scene, depth=WALL_Z, confidence=0.9):
    shape = scene.train[0].camera.size[::-1]
    maps = ViewMaps(depth=np.full(shape, depth, np.float32), depth_confidence=np.full(shape, confidence, np.float32))
    write_trust(folder / "trust.npz", scene.train, {frame.name: maps for frame in scene.train}, {})


def test_the_depth_that_a_run_trusts_is_kept_and_known(scene, wall, tmp_path):
    config = load_config([f"scene.path={wall}", f"out={tmp_path}"])
    trusted(tmp_path, scene, 2.345)
    kept = read_trust(tmp_path / "trust.npz")[scene.train[0].name].depth
    assert kept is not None and np.abs(kept.astype(np.float32) - 2.345).max() < 0.002
    for view in known_views(scene, config, tmp_path):
        (depth,) = view.depths
        assert np.abs(depth - 2.345).max() < 0.002
    trusted(tmp_path, scene, 2.345, confidence=0.3)
    assert not any(depth.any() for view in known_views(scene, config, tmp_path) for depth in view.depths)
    (tmp_path / "trust.npz").unlink()
    assert all(view.depths == () for view in known_views(scene, config, tmp_path))


def test_a_mesh_behind_what_the_run_trusts_covers_nothing_known(scene, wall, tmp_path):
    config = load_config([f"scene.path={wall}", f"out={tmp_path}"])
    trusted(tmp_path, scene, 1.0)
    mesh = trimesh.Trimesh([[-9, -9, 2], [9, -9, 2], [9, 9, 2], [-9, 9, 2]], [[0, 2, 1], [0, 3, 2]], process=False)
    figures = measure(mesh, known_views(scene, config, tmp_path)).figures
    assert figures["known"] == 1
    assert figures["coverage_known"] == figures["coverage"] == 0


def test_a_mesh_without_a_truth_is_judged_and_pictured(scene, wall, tmp_path):
    capture = tmp_path / "capture"
    capture.mkdir()
    for path in wall.iterdir():
        if path.name != "gt_mesh.ply":
            (capture / path.name).symlink_to(path)
    assert scene.gt_mesh is not None
    half = trimesh.load(scene.gt_mesh, process=False)
    half.vertices = np.asarray(half.vertices) * (0.5, 1, 1)
    half.export(tmp_path / "half.ply")
    assert cli.main(["eval", f"pred={tmp_path / 'half.ply'}", f"scene={capture}", f"out={tmp_path / 'scores'}"]) == 0
    metrics = json.loads((tmp_path / "scores/metrics.json").read_text())
    assert 0.1 < metrics["mesh_quality"]["coverage"] < 0.9
    assert metrics.get("f_score_5cm") is None
    assert cv2.imread(str(tmp_path / "scores/eval/quality.png")).std() > 10
