"""Scoring files of a scene, end to end."""

import json

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.captures.scene import Frame, Scene
from room2dgs.errors import InputError
from room2dgs.eval.run import evaluate
from room2dgs.eval.shading import error_color
from room2dgs.mesh.io import read_mesh, write_mesh


@pytest.fixture
def scene(make, tmp_path):
    frames = []
    for index, camera in enumerate(make.all_around()):
        path = tmp_path / f"{index}.png"
        cv2.imwrite(str(path), np.full((camera.height, camera.width, 3), 90, np.uint8))
        frames.append(Frame(f"{index:06d}", camera, path))
    write_mesh(tmp_path / "gt.ply", make.room())
    return Scene(tmp_path, tuple(frames[:4]), tuple(frames[4:]), gt_mesh=tmp_path / "gt.ply")


def score(make, scene, pred, out, log=None, **changes):
    path = scene.path / "pred.ply"
    write_mesh(path, pred)
    changes = {"samples": 4000, **changes}
    return evaluate(path, scene.gt_mesh, scene, make.config(**changes), out, log or (lambda _: None))


def test_files_keys_and_pictures(make, scene, tmp_path):
    out, lines = tmp_path / "run", []
    pred = make.room(spacing=0.25)
    far = np.abs(pred.vertices[:, 1] - 1.5) < 1e-9
    pred.vertices[far, 1] += 0.2
    part = score(make, scene, pred, out, lines.append)
    assert json.loads((out / "metrics.json").read_text())["f_score_5cm"] == part["f_score_5cm"]
    assert {"accuracy_m", "completion_m", "precision_5cm", "recall_5cm", "chamfer_m"} <= part.keys()
    assert "f_score_2cm" not in part
    assert "f_score_2cm" in part["protocols"]["area"]
    assert len(part["protocols"]["area"]["constants"]["pred_sha256"]) == 64
    colored = read_mesh(out / "eval" / "error.ply")
    red, blue = (error_color(np.array([x]), 1.0)[0] * 255 for x in (1, 0))
    colors = colored.visual.vertex_colors[:, :3]
    moved = np.abs(colored.vertices[:, 1] - 1.7) < 1e-6
    assert np.abs(colors[moved] - red).max() < 1
    assert np.abs(colors[colored.vertices[:, 1] < 1.2] - blue).max() < 1
    for name in ("views.png", "top.png"):
        picture = cv2.imread(str(out / "eval" / name))
        assert picture.std() > 5, name
    assert any("F-score @ 5cm" in line for line in lines)
    assert any(line.startswith("mesh that is wrong") for line in lines)
    assert not list(out.rglob("*.tmp"))


def test_protocols_stand_by_name_and_the_first_leads(make, scene, tmp_path):
    lines = []
    part = score(
        make,
        scene,
        make.room(),
        tmp_path / "run",
        lines.append,
        protocols=["neuris", "area"],
        threshold_m=0.1,
    )
    assert part["protocol"] == "neuris"
    assert part["f_score_10cm"] == part["protocols"]["neuris"]["f_score_10cm"]
    assert list(part["protocols"]) == ["neuris", "area"]
    assert any("neuris compares vertices" in line and "gt.ply" in line for line in lines)


def test_a_mesh_nobody_sees_still_gives_a_report(make, scene, tmp_path):
    part = score(make, scene, trimesh.creation.box((0.01, 0.01, 0.01)), tmp_path / "run")
    assert part["accuracy_m"] is None
    assert part["f_score_5cm"] == 0
    assert json.loads((tmp_path / "run" / "metrics.json").read_text())["recall_5cm"] == 0


def test_missing_files_are_named_and_nothing_is_written(make, scene, tmp_path):
    write_mesh(tmp_path / "here.ply", make.room())
    here, gone, out = tmp_path / "here.ply", tmp_path / "gone.ply", tmp_path / "run"
    for pred, gt in ((gone, here), (here, gone)):
        with pytest.raises(InputError, match=r"gone\.ply is missing"):
            evaluate(pred, gt, scene, make.config(), out, lambda _: None)
    with pytest.raises(InputError, match=r"eval\.protocols is empty"):
        evaluate(here, here, scene, make.config(protocols=[]), out, lambda _: None)
    assert not out.exists()
