"""A capture with depth from the command line: used by default, said, off with one word, and marked in the scores."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs import cli
from room2dgs.captures.read import read_scene
from room2dgs.commands.ablate import DEFAULTS as ABLATE
from room2dgs.config import load_config
from room2dgs.depth import depth_of_frames
from room2dgs.sfm.sparse import sparse_points
from room2dgs.tools.prior_error.__main__ import DEFAULTS as PRIOR_ERROR

ROOT = Path(__file__).resolve().parents[2]
WALL_Z = 2.0
QUICK = [
    *("points.source=file", "seeds.voxel_m=0.1", "train.iterations=20", "train.tensorboard=false", "mesh.voxel_m=0.05"),
    *("mesh.min_triangles=1", "eval.samples=2000", "prior/normal=none"),
]


@pytest.fixture(scope="module")
def capture(wall, tmp_path_factory) -> Path:
    """The wall with depth in millimetres, but for one photo."""
    folder = shutil.copytree(wall, tmp_path_factory.mktemp("sensor") / "wall")
    (folder / "depth").mkdir()
    depth = np.full((24, 32), 1000 * WALL_Z, np.uint16)  # half the photos' size
    depth[:4, :4] = 0
    for view in range(1, 8):
        cv2.imwrite(str(folder / f"depth/{view}.png"), depth)
    return folder


def settings(capture: Path, out: Path) -> list[str]:
    return [f"scene.path={capture}", f"out={out}", f"points.file={capture / 'points.ply'}", *QUICK]


@pytest.fixture(scope="module")
def finished(capture, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "sensor"
    assert cli.main(["run", *settings(capture, out)]) == 0
    return out


def metrics_of(out: Path) -> dict:
    return json.loads((out / "metrics.json").read_text())


def test_a_capture_with_depth_is_run_with_it_and_says_so(finished):
    said = (finished / "log.txt").read_text()
    assert "depth: sensor (6 of 7 photos)" in said and "prior/depth=room_prior" in said
    assert "1 of 7 photos have no depth file" in said
    metrics = metrics_of(finished)
    assert metrics["depth_source"] == "sensor" and metrics["priors"] == "sensor"
    assert metrics["f_score_5cm"] > 0.7
    assert (finished / "priors.csv").read_text().count("\n") == 7  # a line a view, and the head


def test_what_training_gets_is_what_the_files_say(capture, finished):
    config = load_config([], finished / "config.yaml")
    scene = read_scene(config.scene)
    priors = depth_of_frames(scene.train, sparse_points(scene, config.points, finished / "points"), config.prior)
    for frame in scene.train:
        if frame.depth_path is not None:
            depth = priors.by_frame[frame.name].depth
            assert not depth[:8, :8].any()
            np.testing.assert_allclose(np.unique(depth), [0, WALL_Z], rtol=1e-4)


def test_a_truth_that_lies_on_that_depth_is_marked(finished, capture, tmp_path):
    metrics = metrics_of(finished)
    assert metrics["truth_from_same_depth"] is True
    assert metrics["depth_to_truth_m"] < 0.002
    assert "NOTE: the ground truth lies" in (finished / "log.txt").read_text()


def test_a_truth_elsewhere_is_not_and_a_new_mesh_forgets_the_mark(finished, capture, tmp_path):
    import trimesh

    run = Path(shutil.copytree(finished, tmp_path / "copy"))
    other = trimesh.load(capture / "gt_mesh.ply", process=False)
    other.apply_translation((0, 0, 0.02))
    other.export(tmp_path / "laser.ply")
    assert cli.main(["mesh", f"out={run}"]) == 0
    assert metrics_of(run)["truth_from_same_depth"] is None
    assert cli.main(["eval", f"out={run}", f"eval.gt={tmp_path / 'laser.ply'}"]) == 0
    metrics = metrics_of(run)
    assert metrics["truth_from_same_depth"] is False
    assert metrics["depth_to_truth_m"] == pytest.approx(0.02, abs=0.002)


def test_one_word_leaves_the_depth_alone(capture, tmp_path):
    out = tmp_path / "photos"
    assert cli.main(["run", *settings(capture, out), "prior=none"]) == 0
    metrics = metrics_of(out)
    assert metrics["depth_source"] == "none" and metrics["truth_from_same_depth"] is False
    assert "depth: sensor" not in (out / "log.txt").read_text()


def test_the_wrong_unit_is_one_sentence_and_leaves_no_run_behind(capture, tmp_path, capsys):
    out = tmp_path / "metres"
    assert cli.main(["run", *settings(capture, out), "prior.depth.unit_m=1"]) == 2
    said = capsys.readouterr().err
    assert "prior.depth.unit_m=0.001 (now 1)" in said and said.count("\n") == 1
    assert not out.exists()


def test_the_demo_and_the_studies_compare_photos_alone():
    (line,) = (line for line in (ROOT / "Makefile").read_text().splitlines() if "room2dgs run" in line)
    assert "prior=room_prior" in line
    assert "prior=room_prior" in ABLATE and "prior=room_prior" in PRIOR_ERROR


def test_depth_is_scored_in_each_photo(finished, capture, wall, tmp_path, capsys):
    run = Path(shutil.copytree(finished, tmp_path / "copy"))
    assert cli.main(["eval", f"out={run}", "eval.protocols=[area,depth]"]) == 0
    metrics = metrics_of(run)
    scores = metrics["depth_scores"]
    assert metrics["f_score_5cm"] > 0.7 and metrics["depth_source"] == "sensor"
    assert scores["mesh"]["all"]["within_5cm"] > 0.8 and scores["surfels"]["all"]["abs_rel"] < 0.05
    assert scores["mesh"]["training"]["views"] > scores["mesh"]["held_out"]["views"] > 0
    assert scores["constants"]["run_used_this_depth"] is True
    log = (run / "log.txt").read_text()
    assert "depth of the mesh, by the sensor's" in log and "depth of the surfels, by the sensor's" in log
    assert "protocol depth says nothing of photos alone" in log
    assert cli.main(["report", f"out={run}"]) == 0
    assert "depth of the mesh, held-out photos" in (run / "report.html").read_text()
    assert cli.main(["mesh", f"out={run}"]) == 0
    assert metrics_of(run)["depth_scores"] is None and metrics_of(run)["depth_source"] == "sensor"
    given = [f"pred={capture / 'gt_mesh.ply'}", f"scene={capture}", "eval.protocols=[depth]", f"out={tmp_path / 'gt'}"]
    assert cli.main(["eval", *given]) == 0
    assert metrics_of(tmp_path / "gt")["depth_scores"]["mesh"]["all"]["within_2cm"] > 0.99
    capsys.readouterr()
    given[1], given[3] = f"scene={wall}", f"out={tmp_path / 'none'}"
    assert cli.main(["eval", *given]) == 2
    assert "has no depth maps, which protocol depth needs" in capsys.readouterr().err
