"""Refined poses in the folder of a run: every command on the run works with them."""

from __future__ import annotations

import json
import shutil

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs import cli

SETTINGS = [
    "prior=none",
    "points.max_features=1000",
    "scene.test_every=4",
    "seeds.voxel_m=0.1",
    "train.iterations=12",
    "train.checkpoint_every=6",
    "train.tensorboard=false",
    "mesh.voxel_m=0.05",
    "mesh.min_triangles=1",
]


@pytest.fixture(scope="module")
def shaken(tmp_path_factory, corner_views):
    """A capture of the corner whose poses are off by 0.7 degrees and 1.2 cm."""
    root = tmp_path_factory.mktemp("shaken") / "capture"
    for folder in ("color", "pose", "intrinsic"):
        (root / folder).mkdir(parents=True)
    K = np.eye(4)
    K[:3, :3] = [[260, 0, 159.5], [0, 260, 119.5], [0, 0, 1]]
    np.savetxt(root / "intrinsic/intrinsic_color.txt", K)
    random = np.random.default_rng(5)
    for index, (pose, photo, _) in enumerate(corner_views):
        cv2.imwrite(str(root / f"color/{index}.png"), photo)
        off = pose.copy()
        turn, shift = random.normal(size=(2, 3)) / np.sqrt(3)
        off[:3, :3] = Rotation.from_rotvec(np.radians(0.7) * turn).as_matrix() @ pose[:3, :3]
        off[:3, 3] += 0.012 * shift
        np.savetxt(root / f"pose/{index}.txt", off, fmt="%.12f")
    return root


@pytest.fixture(scope="module")
def finished(shaken, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "finished"
    assert cli.main(["run", f"scene.path={shaken}", f"out={out}", *SETTINGS]) == 0
    return out


@pytest.fixture
def run_copy(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "copy")


def metrics_of(out) -> dict:
    return json.loads((out / "metrics.json").read_text())


def test_a_run_refines_says_so_and_keeps_both_kinds_of_poses(finished):
    content = json.loads((finished / "poses.json").read_text())
    assert len(content["cam_from_world"]) == 8
    poses = [[np.array(pose[which]) for pose in content["cam_from_world"].values()] for which in ("given", "refined")]
    ways = [np.abs(given - refined).max() for given, refined in zip(*poses, strict=True)]
    assert min(ways) > 1e-4 and max(ways) < 0.1
    report = metrics_of(finished)["poses"]
    assert report == content["report"] and report["refined"] and report["after_px"] < 0.5 * report["before_px"]
    log = (finished / "log.txt").read_text()
    assert "poses refined: reprojection error " in log and log.count("matching") == 1


def test_mesh_and_scores_of_later_commands_are_of_the_refined_poses(finished, run_copy):
    assert cli.main(["mesh", f"out={run_copy}"]) == 0
    assert (run_copy / "mesh.ply").read_bytes() == (finished / "mesh.ply").read_bytes()
    before = {path.name: path.read_bytes() for path in (finished / "renders/test").iterdir()}
    shutil.rmtree(run_copy / "renders")
    assert cli.main(["render", f"out={run_copy}"]) == 0
    assert {path.name: path.read_bytes() for path in (run_copy / "renders/test").iterdir()} == before
    assert cli.main(["eval", f"out={run_copy}"]) == 0
    assert metrics_of(run_copy)["psnr_db"] == metrics_of(finished)["psnr_db"]
    # the given poses would have given other files
    (run_copy / "poses.json").unlink()
    assert cli.main(["mesh", f"out={run_copy}"]) == 0
    assert (run_copy / "mesh.ply").read_bytes() != (finished / "mesh.ply").read_bytes()


def test_a_resumed_run_takes_the_poses_from_its_folder_and_gives_the_same_bits(finished, run_copy):
    (run_copy / "checkpoints/iteration_0000012.safetensors").unlink()
    for name in ("surfels.safetensors", "mesh.ply"):
        (run_copy / name).unlink()
    lines = len((run_copy / "log.txt").read_text().splitlines())
    assert cli.main(["run", f"out={run_copy}", "resume=true"]) == 0
    for name in ("surfels.safetensors", "mesh.ply", "poses.json"):
        assert (run_copy / name).read_bytes() == (finished / name).read_bytes()
    said = "\n".join((run_copy / "log.txt").read_text().splitlines()[lines:])
    assert "matching" not in said and "resuming after iteration 6" in said


def test_a_run_resumes_only_with_the_same_way_to_its_poses(run_copy, capsys):
    assert cli.main(["run", f"out={run_copy}", "resume=true", "sfm.refine_poses=false"]) == 2
    assert "was trained with sfm.refine_poses=auto" in capsys.readouterr().err


def test_before_training_a_run_resumes_with_the_poses_that_its_settings_ask_for(finished, run_copy):
    """poses.json of other settings, or of other frames, is no longer this run's."""
    shutil.rmtree(run_copy / "checkpoints")
    for name in ("surfels.safetensors", "mesh.ply"):
        (run_copy / name).unlink()
    shorter = ["train.iterations=1", "train.checkpoint_every=1"]
    lines = len((run_copy / "log.txt").read_text().splitlines())
    assert cli.main(["run", f"out={run_copy}", "resume=true", *shorter]) == 0
    assert (run_copy / "poses.json").read_bytes() == (finished / "poses.json").read_bytes()
    said = "\n".join((run_copy / "log.txt").read_text().splitlines()[lines:])
    assert "matching" not in said  # what has stayed the same is not done again
    assert metrics_of(run_copy)["seconds"]["poses"] == metrics_of(finished)["seconds"]["poses"]
    shutil.rmtree(run_copy / "checkpoints")
    assert cli.main(["run", f"out={run_copy}", "resume=true", "sfm.refine_poses=false", *shorter]) == 0
    assert not json.loads((run_copy / "poses.json").read_text())["report"]["refined"]


def test_other_given_poses_are_refused(shaken, run_copy, tmp_path, capsys):
    capture = shutil.copytree(shaken, tmp_path / "capture")
    pose = np.loadtxt(capture / "pose/2.txt")
    pose[0, 3] += 0.01
    np.savetxt(capture / "pose/2.txt", pose)
    assert cli.main(["mesh", f"out={run_copy}", f"scene.path={capture}"]) == 2
    assert "was made for another pose of 000002" in capsys.readouterr().err


def test_depth_works_with_refined_poses_too(shaken, tmp_path):
    out = tmp_path / "depth"
    arguments = [f"scene.path={shaken}", f"out={out}", "points.max_features=1000", "mesh.voxel_m=0.05"]
    assert cli.main(["depth", *arguments, "stereo.width=160", "scene.test_every=4"]) == 0
    assert metrics_of(out)["poses"]["refined"] and (out / "poses.json").is_file()
