"""Scoring files of a scene, end to end, and the library on its own."""

import subprocess
import sys

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs.captures.scene import Frame, Scene
from room2dgs.errors import InputError
from room2dgs.eval import evaluate, write_pictures
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


def score(scene, pred, **changes):
    path = scene.path / "pred.ply"
    write_mesh(path, pred)
    cameras = [frame.camera for frame in scene.frames]
    return evaluate(path, scene.gt_mesh, cameras, **{"samples": 4000, **changes})


def test_files_keys_and_pictures(make, scene, tmp_path):
    pred = make.room(spacing=0.25)
    far = np.abs(pred.vertices[:, 1] - 1.5) < 1e-9
    pred.vertices[far, 1] += 0.2
    found = score(scene, pred)
    part, lines, out = found.as_dict(), found.lines(), tmp_path / "run"
    write_pictures(found, scene.frames, out)
    assert part["f_score_5cm"] == found.scores.at[2].f_score
    assert {"accuracy_m", "completion_m", "precision_5cm", "recall_5cm", "chamfer_m"} <= part.keys()
    assert "f_score_2cm" not in part
    assert "f_score_2cm" in part["protocols"]["area"]
    assert len(part["protocols"]["area"]["constants"]["pred_sha256"]) == 64
    colored = read_mesh(out / "error.ply")
    red, blue = (error_color(np.array([x]), 1.0)[0] * 255 for x in (1, 0))
    colors = colored.visual.vertex_colors[:, :3]
    moved = np.abs(colored.vertices[:, 1] - 1.7) < 1e-6
    assert np.abs(colors[moved] - red).max() < 1
    assert np.abs(colors[colored.vertices[:, 1] < 1.2] - blue).max() < 1
    for name in ("views.png", "top.png"):
        picture = cv2.imread(str(out / name))
        assert picture.std() > 5, name
    assert "F-score @ 5cm" in lines[0]
    assert any(line.startswith("mesh that is wrong") for line in lines)
    assert not list(out.rglob("*.tmp"))


def test_the_expected_error_is_drawn_beside_the_true_one(make, scene, tmp_path):
    pred = make.room(spacing=0.25)
    pred.vertex_attributes["expected_error"] = np.full(len(pred.vertices), 0.1, np.float32)
    write_pictures(score(scene, pred), scene.frames, tmp_path)
    picture = cv2.imread(str(tmp_path / "expected.png"))[:, :, ::-1].astype(int)
    third = picture.shape[1] // 3
    told, true = picture[:, third : 2 * third], picture[:, 2 * third :]
    # red: 10 cm are expected everywhere; blue: nothing is off
    assert (told[..., 0] - told[..., 2] > 60).mean() > 0.5 and (true[..., 2] - true[..., 0] > 60).mean() > 0.5
    write_pictures(score(scene, make.room()), scene.frames, tmp_path)
    assert not (tmp_path / "expected.png").exists()


def test_protocols_stand_by_name_and_the_first_leads(make, scene):
    found = score(scene, make.room(), protocols=["neuris", "area"], threshold_m=0.1)
    part, lines = found.as_dict(), found.lines()
    assert part["protocol"] == "neuris"
    assert part["f_score_10cm"] == part["protocols"]["neuris"]["f_score_10cm"]
    assert list(part["protocols"]) == ["neuris", "area"]
    assert any("neuris compares vertices" in line and "gt.ply" in line for line in lines)


def test_a_mesh_nobody_sees_still_gives_a_report(make, scene, tmp_path):
    found = score(scene, trimesh.creation.box((0.01, 0.01, 0.01)))
    write_pictures(found, scene.frames, tmp_path / "run")
    part = found.as_dict()
    assert part["accuracy_m"] is None
    assert part["f_score_5cm"] == 0
    assert part["recall_5cm"] == 0
    assert (tmp_path / "run" / "views.png").is_file()


def test_bad_input_is_one_sentence(make, scene, tmp_path):
    write_mesh(tmp_path / "here.ply", make.room())
    here, gone, cameras = tmp_path / "here.ply", tmp_path / "gone.ply", [scene.frames[0].camera]
    for pred, gt in ((gone, here), (here, gone)):
        with pytest.raises(InputError, match=r"gone\.ply is missing"):
            evaluate(pred, gt, cameras)
    with pytest.raises(InputError, match="no protocol is named"):
        evaluate(here, here, cameras, protocols=[])
    with pytest.raises(InputError, match="protocol 'monosdf' is not known; choose from area, neuris, manhattan"):
        evaluate(here, here, cameras, protocols=["area", "monosdf"])
    with pytest.raises(InputError, match="there is no camera"):
        evaluate(here, here, [])


def test_a_mesh_scores_as_its_file_does(make, scene):
    cameras = [frame.camera for frame in scene.frames]
    mesh = read_mesh(scene.gt_mesh)
    one = evaluate(mesh, mesh, cameras, samples=2000)
    other = evaluate(str(scene.gt_mesh), scene.gt_mesh, cameras, samples=2000)
    assert one.scores == other.scores
    assert one.results["area"].constants["pred_sha256"] is None


def test_the_library_needs_nothing_of_training_or_commands():
    code = """
import sys
from room2dgs.eval import PROTOCOLS, evaluate, image_scores, write_pictures
import room2dgs.eval.protocol_manhattan
for part in ("train", "commands", "priors", "bench", "study", "seeds", "splat", "losses", "sfm", "cli"):
    found = [name for name in sys.modules if name == f"room2dgs.{part}" or name.startswith(f"room2dgs.{part}.")]
    assert not found, found
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
