"""The commands as a person types them: files, exit codes, sentences."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import types
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.commands.settings_help import FIRST
from room2dgs.config import load_config
from room2dgs.config.keys import leaf_keys
from room2dgs.errors import InputError
from room2dgs.runs.folder import claimed

WIDTH, HEIGHT = 64, 48  # of the wall's photos
WALL_Z = 2.0
QUICK = [
    "points.source=file",
    "seeds.voxel_m=0.1",
    "train.iterations=40",
    "train.rates.color=0.05",
    "train.checkpoint_every=20",
    "train.tensorboard=false",
    "mesh.voxel_m=0.05",
    "mesh.min_triangles=1",
    "mesh.max_error_m=null",
    "eval.samples=2000",
]


@pytest.fixture(scope="module")
def scene(wall) -> Path:
    return wall


def settings(scene: Path, out: Path) -> list[str]:
    return [f"scene.path={scene}", f"out={out}", f"points.file={scene / 'points.ply'}", *QUICK]


@pytest.fixture(scope="module")
def finished(scene, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "finished"
    assert cli.main(["run", *settings(scene, out)]) == 0
    return out


@pytest.fixture
def run_copy(finished, tmp_path) -> Path:
    import shutil

    return Path(shutil.copytree(finished, tmp_path / "copy"))


def metrics_of(out: Path) -> dict:
    return json.loads((out / "metrics.json").read_text())


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def refused(capsys, argv: list[str]) -> str:
    """Runs a command that must be refused; returns its one sentence."""
    capsys.readouterr()
    assert cli.main(argv) == 2
    said = capsys.readouterr().err
    assert said.startswith("room2dgs: ")
    assert said.count("\n") == 1
    return said


def test_nothing_of_the_training_is_in_memory_when_the_mesh_is_made(scene, tmp_path, monkeypatch):
    from room2dgs.pipeline import reconstruct

    in_memory = {}

    def watched(name, stage):
        def watching(scene, *rest):
            result = stage(scene, *rest)
            in_memory[name] = scene.cache.in_memory
            return result

        return watching

    monkeypatch.setattr(reconstruct, "points_and_priors", watched("priors", reconstruct.points_and_priors))
    monkeypatch.setattr(reconstruct, "train_surfels", watched("training", reconstruct.train_surfels))
    assert cli.main(["run", *settings(scene, tmp_path / "run"), "report.enabled=false"]) == 0
    assert in_memory["priors"] > 0 and in_memory["training"] == 0


def test_run_leaves_what_the_readme_promises(finished, scene):
    names = {path.name for path in finished.iterdir()}
    assert {"config.yaml", "mesh.ply", "metrics.json", "log.txt", "checkpoints", "renders", "report.html"} <= names
    assert not [path for path in finished.rglob("*") if path.name.endswith(".tmp")]
    metrics = metrics_of(finished)
    assert 0.9 < metrics["precision_5cm"] <= 1 and 0 < metrics["recall_5cm"] <= 1
    for key in ("f_score_5cm", "accuracy_m", "completion_m", "psnr_db", "psnr_fitted_db", "ssim", "peak_memory_mb"):
        assert isinstance(metrics[key], float)
    assert metrics["protocols"]["area"]["constants"]["threshold_m"] == 0.05
    before = {"read", "poses", "points", "priors", "exposure"}
    stages = {*before, "train", "mesh", "texture", "export", "render", "eval", "report", "verdict"}
    assert set(metrics["seconds"]) == stages
    # thinned: the surfels that are left are a seed each
    assert metrics["primitives"] == metrics["seeds"] and "of what the views show" in (finished / "log.txt").read_text()
    assert metrics["mesh_voxel_m"] == load_config([], finished / "config.yaml").mesh.voxel_m
    assert metrics["versions"]["python"] == sys.version.split()[0]
    assert metrics["machine"]["cores"] >= 1
    assert "iteration 40/40" in (finished / "log.txt").read_text()


def test_the_mesh_is_the_wall(finished):
    vertices = trimesh.load(finished / "mesh.ply", process=False).vertices
    assert np.median(np.abs(vertices[:, 2] - WALL_Z)) < 0.02


def test_saved_configuration_is_whole_and_absolute(finished, scene):
    config = load_config([], finished / "config.yaml")
    assert config.scene.path == str(scene)
    assert config.out == str(finished)
    assert config.train.iterations == 40
    assert config.resume is False


def test_renders_show_photo_color_depth_normal_side_by_side(finished):
    (path,) = (finished / "renders" / "test").iterdir()
    picture = cv2.imread(str(path))
    assert picture.shape == (HEIGHT, 4 * WIDTH, 3)
    photo, color, _, normal = np.split(picture[..., ::-1].astype(int), 4, axis=1)
    assert np.abs(photo - color).mean() < np.abs(photo - photo.mean((0, 1))).mean()
    # the wall faces the cameras: right 0, up 0, towards the camera 1
    assert np.abs(np.median(normal.reshape(-1, 3), axis=0) - (128, 128, 255)).max() < 40


def test_an_earlier_run_is_not_overwritten(finished, scene, capsys):
    before = files_of(finished)
    said = refused(capsys, ["run", *settings(scene, finished)])
    assert "resume=true" in said and "another out=DIR" in said
    assert files_of(finished) == before


@pytest.mark.parametrize("resume", ["true", "false"])
def test_a_folder_with_other_things_is_not_taken(scene, tmp_path, capsys, resume):
    (tmp_path / "letter.txt").write_text("dear")
    argv = ["run", *settings(scene, tmp_path), f"resume={resume}", f"points.file={tmp_path / 'gone.ply'}"]
    assert "is not empty" in refused(capsys, argv)
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_what_lay_in_the_folder_stays_when_nothing_comes_of_a_run(scene, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    (tmp_path / "photos").mkdir()
    with pytest.raises(InputError), claimed(load_config([f"scene.path={scene}", f"out={tmp_path}"])) as out:
        (out / "half.ply").write_text("ply")
        (out / "points").mkdir()
        raise InputError("too few points")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["letter.txt", "photos"]


def test_resume_needs_only_the_folder_and_gives_the_same_mesh(run_copy, tmp_path, monkeypatch):
    before = files_of(run_copy)
    (run_copy / "checkpoints/iteration_0000040.safetensors").unlink()
    (run_copy / "mesh.ply").unlink()
    (run_copy / "surfels.safetensors").unlink()
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "out=copy", "resume=true"]) == 0
    after = files_of(run_copy)
    assert after["surfels.safetensors"] == before["surfels.safetensors"]
    assert after["mesh.ply"] == before["mesh.ply"]


def test_a_refused_resume_keeps_the_old_configuration(run_copy, capsys):
    before = (run_copy / "config.yaml").read_bytes()
    assert "loss.dssim" in refused(capsys, ["run", f"out={run_copy}", "resume=true", "loss.dssim=0.5"])
    assert (run_copy / "config.yaml").read_bytes() == before


def test_mesh_again_with_other_settings(run_copy, capsys):
    faces = metrics_of(run_copy)["mesh_faces"]
    assert cli.main(["mesh", f"out={run_copy}", "mesh.voxel_m=0.1"]) == 0
    metrics = metrics_of(run_copy)
    assert metrics["mesh_faces"] < faces / 2
    assert metrics["f_score_5cm"] is None and metrics["protocols"] is None  # they were the old mesh's
    assert metrics["psnr_db"] is not None
    assert load_config([], run_copy / "config.yaml").mesh.voxel_m == 0.1
    assert cli.main(["eval", f"out={run_copy}"]) == 0
    assert metrics_of(run_copy)["f_score_5cm"] > 0


def test_a_refused_mesh_changes_nothing(run_copy, capsys):
    before = files_of(run_copy)
    assert "mesh.min_weight" in refused(capsys, ["mesh", f"out={run_copy}", "mesh.min_weight=1000"])
    assert files_of(run_copy) == before


def test_eval_of_any_mesh_by_short_names(finished, scene, tmp_path):
    out = tmp_path / "scores"
    short = [f"pred={scene / 'gt_mesh.ply'}", f"gt={scene / 'gt_mesh.ply'}", f"scene={scene}", f"out={out}"]
    assert cli.main(["eval", *short, "eval.samples=2000"]) == 0
    metrics = metrics_of(out)
    assert metrics["f_score_5cm"] == 1.0
    assert cli.main(["eval", *short, "eval.samples=2000", "eval.threshold_m=0.1"]) == 0
    metrics = metrics_of(out)
    assert metrics["f_score_10cm"] == 1.0
    assert metrics["f_score_5cm"] is None  # of other settings than the rest of the scores
    assert metrics["accuracy_m"] < 1e-6


def test_eval_takes_the_captures_own_ground_truth_and_a_folder_beside_the_mesh(scene, tmp_path):
    mesh = trimesh.load(scene / "gt_mesh.ply", process=False)
    mesh.apply_translation((0, 0, 0.2))
    mesh.export(tmp_path / "far.ply")
    assert cli.main(["eval", f"pred={tmp_path / 'far.ply'}", f"scene={scene}", "eval.samples=2000"]) == 0
    metrics = metrics_of(tmp_path / "far_scores")
    assert metrics["f_score_5cm"] == 0.0
    assert metrics["accuracy_m"] == pytest.approx(0.2, abs=1e-3)


def test_render_of_training_views(run_copy):
    assert cli.main(["render", f"out={run_copy}", "views=train"]) == 0
    assert len(list((run_copy / "renders/train").iterdir())) == 7


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["walk"], "'walk' is no command; choose from demo, app, prepare, run, train, depth, mesh"),
        (["run"], "out is not given"),
        (["run", "out=x"], "scene.path is not given"),
        (["run", "scene.path=nowhere", "out=x"], "nowhere is not there"),
        (["run", "scene.path=nowhere", "out=x", "train.iteration=1"], "did you mean train.iterations"),
        (["run", "scene.path=nowhere", "out=x", "eval.gt=gone.ply"], "gone.ply is missing"),
        (["train", "scene.path=nowhere", "out=/dev/null"], "/dev/null is a file"),
        (["mesh"], "out is not given"),
        (["mesh", "out=nowhere"], "nowhere holds no run"),
        (["render", "out=nowhere", "views=some"], "choose from test, train, all"),
        (["eval"], "pred=MESH scene=DIR"),
        (["eval", "pred=gone.ply", "scene=nowhere"], "gone.ply is missing"),
        (["bench", "sleep"], "choose from raster"),
        (["doctor", "who"], "doctor takes no argument"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(argv, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, argv)
    assert list(tmp_path.iterdir()) == []


def test_bad_input_that_shows_late_leaves_nothing(scene, tmp_path, capsys):
    out = tmp_path / "run"
    argv = ["run", *settings(scene, out), f"points.file={tmp_path / 'gone.ply'}"]
    assert "gone.ply is missing" in refused(capsys, argv)
    assert not out.exists()
    out.mkdir()
    refused(capsys, argv)
    assert list(out.iterdir()) == []


def test_our_fault_keeps_the_traceback_in_the_runs_log(scene, tmp_path, monkeypatch, capsys):
    import room2dgs.sfm.sparse

    def broken(*_, **__):
        raise RuntimeError("a wheel came off\nsecond line")

    monkeypatch.setattr(room2dgs.sfm.sparse, "sparse_points", broken)
    out = tmp_path / "run"
    assert cli.main(["run", *settings(scene, out)]) == 1
    said = capsys.readouterr().err
    assert "RuntimeError: a wheel came off; this is not your fault" in said
    assert "Traceback" not in said and str(out / "log.txt") in said
    assert "in broken" in (out / "log.txt").read_text()


def test_our_fault_without_a_run_keeps_the_traceback_too(monkeypatch, tmp_path, capsys):
    import room2dgs.commands.doctor
    from room2dgs.logs import LOGGER

    def broken(_):
        raise ZeroDivisionError("nothing to share")

    monkeypatch.setattr(room2dgs.commands.doctor, "main", broken)
    monkeypatch.setattr(LOGGER, "handlers", [])  # of runs of other tests
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert cli.main(["doctor"]) == 1
    (path,) = tmp_path.glob("room2dgs_*.log")
    assert str(path) in capsys.readouterr().err
    assert "ZeroDivisionError" in path.read_text()


def test_interrupt_and_full_disk(monkeypatch, capsys):
    import errno

    import room2dgs.commands.doctor

    for error, code, said in (
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(errno.ENOSPC, "No space left on device"), 2, "the disk is full"),
    ):

        def broken(_, error=error):
            raise error

        monkeypatch.setattr(room2dgs.commands.doctor, "main", broken)
        assert cli.main(["doctor"]) == code
        assert said in capsys.readouterr().err


def test_bench_hands_the_arguments_over(monkeypatch):
    seen = []
    stub = types.ModuleType("room2dgs.bench.raster")
    stub.main = seen.append
    monkeypatch.setitem(sys.modules, "room2dgs.bench.raster", stub)
    assert cli.main(["bench", "raster", "--quick"]) == 0
    assert seen == [["--quick"]]


def test_help_is_told_without_loading_torch():
    code = """
import sys
from room2dgs.cli import main
for argv in (["--help"], ["run", "--help"], ["mesh", "--help"], ["eval", "--help"], ["render", "--help"],
             ["bench", "--help"], ["doctor", "--help"], ["train", "--help"]):
    assert main(argv) == 0, argv
assert main(["run", "scene.path=/nowhere", "out=/tmp/none_such_run"]) == 2
assert not {"torch", "open3d", "pycolmap"} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for verb in cli.VERBS:
        assert re.search(rf"^  room2dgs {verb} ", done.stdout, re.MULTILINE)


def test_the_package_runs_as_the_command_does():
    done = subprocess.run([sys.executable, "-m", "room2dgs", "jump"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "'jump' is no command" in done.stderr


@pytest.mark.parametrize(("argv", "everything"), [(["run", "--help"], False), (["train", "-h", "all"], True)])
def test_help_names_some_twenty_settings_and_with_all_every_one(capsys, argv, everything):
    assert cli.main(argv) == 0
    shown = capsys.readouterr().out.partition("\nSettings:\n")[2].partition("\nExamples:")[0]
    assert max(map(len, shown.splitlines())) <= 100
    in_one_line = " ".join(shown.split())
    for key in leaf_keys():
        is_there = len(re.findall(rf"^  {re.escape(key.name)}=.*$", shown, re.MULTILINE))
        assert is_there == (everything or key.name in FIRST), key.name
        assert not is_there or key.comment in in_one_line
    assert 18 <= len(FIRST) <= 24 and all(key.public for key in leaf_keys() if key.name in FIRST)
    assert (f"{len(leaf_keys()) - len(FIRST)} more: --help all" in shown) != everything


def test_help_of_one_section_names_its_public_settings(capsys):
    assert cli.main(["mesh", "--help"]) == 0
    shown = capsys.readouterr().out
    for key in leaf_keys():
        if key.name.startswith("mesh."):
            assert (f"\n  {key.name}=" in shown) == key.public, key.name


@pytest.mark.parametrize("verb", cli.VERBS)
def test_no_help_is_wider_than_a_hundred_columns(verb, capsys):
    with contextlib.suppress(SystemExit):  # argparse
        cli.main([verb, "--help"])
    assert [line for line in capsys.readouterr().out.splitlines() if len(line) > 100] == []
    assert max(map(len, cli.overview().splitlines())) <= 100
