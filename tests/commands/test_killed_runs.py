"""Runs that are killed, started twice or run out of something: what is finished stays, and the next start goes on."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from room2dgs import cli, files
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.pipeline import depth, reconstruct
from room2dgs.runs.folder import claimed, new_run
from room2dgs.train import checkpoint

QUICK = [
    "points.source=file",
    "seeds.voxel_m=0.1",
    "train.iterations=20",
    "train.checkpoint_every=10",
    "train.tensorboard=false",
    "mesh.voxel_m=0.05",
    "mesh.min_triangles=1",
    "mesh.max_error_m=null",
    "render.threads=1",
    "report.enabled=false",
    "prior=none",
]
# Without shares of its length, a run may be prolonged
LONG = [
    "strategy=fixed",
    "loss.multiview_photometric.enabled=false",
    "train.resolutions=[]",
    "train.opacity_floor.until=0",
    "train.iterations=100000",
]
RESULTS = ("mesh.ply", "surfels.safetensors")
TRUE = ("1", "yes", "on", "t", "True")
# Dies as by `kill -9`, at the first call of module.function
KILLED = """
import importlib, os, signal, sys
from room2dgs import cli
module, name, *argv = sys.argv[1:]
def killed(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)
setattr(importlib.import_module(module), name, killed)
sys.exit(cli.main(argv))
"""


def settings(wall: Path, out: Path) -> list[str]:
    return [f"scene.path={wall}", f"out={out}", f"points.file={wall / 'points.ply'}", *QUICK]


def killed(at: str, *argv: str) -> None:
    module, _, name = at.rpartition(".")
    done = subprocess.run([sys.executable, "-c", KILLED, module, name, *argv], stdout=subprocess.DEVNULL, check=False)
    assert done.returncode == -signal.SIGKILL


def results(out: Path) -> dict[str, bytes]:
    return {name: (out / name).read_bytes() for name in RESULTS}


def hidden(out: Path) -> list[str]:
    return sorted(path.name for path in out.rglob(".*"))


def refused(capsys, *argv: str) -> str:
    capsys.readouterr()
    assert cli.main(list(argv)) == 2
    said = capsys.readouterr().err
    assert said.startswith("room2dgs: ") and said.count("\n") == 1
    return said


@pytest.fixture(scope="module")
def wall(tmp_path_factory, wall) -> Path:
    """Without a truth, so that nothing is scored."""
    bare = Path(shutil.copytree(wall, tmp_path_factory.mktemp("capture") / "wall"))
    (bare / "gt_mesh.ply").unlink()
    return bare


@pytest.fixture(scope="module")
def whole(wall, tmp_path_factory) -> Path:
    """A run that nothing happened to."""
    out = tmp_path_factory.mktemp("runs") / "whole"
    assert cli.main(["run", *settings(wall, out)]) == 0
    assert not hidden(out) and not (out / "kept").exists()
    return out


@pytest.fixture
def full(monkeypatch):
    """`full(name)`: the disk has no room for a file whose name has this in it; `full("")`: it has again."""
    fsync, word = os.fsync, [""]

    def limited(handle: int) -> None:
        if word[0] and word[0] in os.readlink(f"/proc/self/fd/{handle}"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(handle)

    monkeypatch.setattr(files.os, "fsync", limited)
    return lambda name: word.__setitem__(0, name)


def test_a_run_killed_before_its_first_file_was_there_is_begun_by_the_same_command(wall, tmp_path, whole, capsys):
    out = tmp_path / "run"
    killed("os.replace", "run", *settings(wall, out))
    assert any(name.startswith(".config.yaml.") for name in hidden(out)) and not (out / "config.yaml").exists()
    assert "holds no run to go on with" in refused(capsys, "run", f"out={out}", "resume=true")
    assert cli.main(["run", *settings(wall, out)]) == 0
    assert results(out) == results(whole) and not hidden(out)


def test_a_run_killed_in_its_mesh_goes_on_there_to_the_same_bits(wall, tmp_path, whole, monkeypatch, capsys):
    out = tmp_path / "run"
    killed("room2dgs.pipeline.reconstruct.make_mesh", "run", *settings(wall, out))
    assert (out / "surfels.safetensors").exists() and not (out / "mesh.ply").exists()
    (out / f".mesh.ply.{os.getppid()}.tmp").write_text("half")
    (out / "points").mkdir()
    (out / "points" / ".sfm-abcdefgh").mkdir()
    before = json.loads((out / "metrics.json").read_text())

    def again(*_, **__):
        raise AssertionError("priors were made again")

    monkeypatch.setattr(depth, "find_priors", again)
    capsys.readouterr()
    assert cli.main(["run", f"out={out}", "resume=yes"]) == 0
    assert "priors are there from before" in capsys.readouterr().out
    assert results(out) == results(whole) and not hidden(out) and not (out / "kept").exists()
    after = json.loads((out / "metrics.json").read_text())
    assert after["seconds"]["priors"] == before["seconds"]["priors"]  # what they took when they were made
    assert after["prior_seconds"] == before["prior_seconds"]


def test_a_run_killed_after_its_mesh_keeps_it(wall, tmp_path, whole, monkeypatch, capsys):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    out = tmp_path / "run"
    monkeypatch.setattr(reconstruct, "write_renders", stopped)
    assert cli.main(["run", *settings(wall, out)]) == 130
    assert f"go on with: room2dgs run out={out} resume=true" in capsys.readouterr().err
    made = (out / "mesh.ply").stat().st_mtime_ns
    assert cli.main(["run", f"out={out}", "resume=true"]) == 130
    assert (out / "mesh.ply").stat().st_mtime_ns == made
    assert cli.main(["run", f"out={out}", "resume=true", "mesh.voxel_m=0.1"]) == 130
    assert (out / "mesh.ply").stat().st_mtime_ns != made and results(out) != results(whole)
    with (out / "mesh.ply").open("ab") as file:
        file.write(b"x")
    monkeypatch.undo()
    assert cli.main(["run", f"out={out}", "resume=true", "mesh.voxel_m=0.05"]) == 0
    assert results(out) == results(whole) and not (out / "kept").exists()
    assert cli.main(["mesh", f"out={out}"]) == 0
    assert results(out) == results(whole) and not (out / "kept").exists()


def test_two_on_one_folder_and_a_kill_in_training(wall, tmp_path, capsys):
    out = tmp_path / "run"
    argv = ["train", *settings(wall, out), *LONG]
    with subprocess.Popen([sys.executable, "-m", "room2dgs.cli", *argv], stdout=subprocess.DEVNULL) as first:
        while not checkpoint.on_disk(out):
            assert first.poll() is None
            time.sleep(0.05)
        for other in (
            ["run", f"out={out}", "resume=true"],
            ["train", f"out={out}", "resume=true"],
            ["mesh", f"out={out}"],
            ["eval", f"out={out}"],
            ["report", f"run={out}"],
            ["render", f"run={out}"],
        ):
            said = refused(capsys, *other)
            assert f"another run works in {out} (process {first.pid}); wait for it" in said
        assert first.poll() is None and (out / "config.yaml").exists()
        first.kill()
    reached = max(checkpoint.load(path).iteration for path in checkpoint.on_disk(out))
    assert cli.main(["train", f"out={out}", "resume=on", f"train.iterations={reached + 1}"]) == 0
    assert (out / "surfels.safetensors").exists() and not hidden(out)


def test_who_comes_second_at_the_same_moment_clears_nothing(wall, tmp_path):
    first = load_config([f"scene.path={wall}", f"out={tmp_path / 'run'}"])
    second = new_run([f"scene.path={wall}", f"out={tmp_path / 'run'}"])  # when nothing was there yet
    with claimed(first) as out:
        (out / "points").mkdir()
    with pytest.raises(InputError, match="holds another run"), claimed(second):
        pass
    assert (out / "config.yaml").exists() and (out / "points").exists()


def test_a_run_that_comes_to_nothing_leaves_what_others_put_there_meanwhile(wall, tmp_path):
    with pytest.raises(InputError), claimed(load_config([f"scene.path={wall}", f"out={tmp_path / 'run'}"])) as out:
        (out / "points").mkdir()
        (out / "letter.txt").write_text("dear")
        raise InputError("too few points")
    assert [path.name for path in out.iterdir()] == ["letter.txt"]


@pytest.mark.parametrize("word", TRUE)
def test_resume_in_any_words_takes_the_saved_settings(whole, tmp_path, word):
    out = Path(shutil.copytree(whole, tmp_path / "run"))
    config = new_run([f"out={out}", f"resume={word}"])
    assert config.resume is True and config.train.iterations == 20 and config.points.source == "file"
    with claimed(config):
        pass
    assert load_config([], out / "config.yaml") == load_config([f"out={out}"], whole / "config.yaml")


@pytest.mark.parametrize("word", ["perhaps", "2", "", "null"])
def test_another_word_is_refused(whole, capsys, word):
    before = (whole / "config.yaml").read_bytes()
    said = refused(capsys, "run", f"out={whole}", f"resume={word}")
    assert f"resume={word} is neither true nor false" in said
    assert (whole / "config.yaml").read_bytes() == before


def test_a_folder_without_a_run_cannot_be_gone_on_with(tmp_path, capsys):
    said = refused(capsys, "run", f"out={tmp_path / 'nothing'}", "resume=true")
    assert f"{tmp_path / 'nothing'} holds no run to go on with" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["iteration_0000010", "mesh.ply"])
def test_a_disk_that_fills_leaves_what_is_finished_to_go_on_with(wall, tmp_path, whole, full, capsys, name):
    out = tmp_path / "run"
    full(name)
    said = refused(capsys, "run", *settings(wall, out))
    assert said.startswith(f"room2dgs: the disk is full: {out}") and name in said
    assert said.endswith(f"make room, then go on with: room2dgs run out={out} resume=true\n")
    assert (out / "config.yaml").exists() and not hidden(out)
    full("")
    assert cli.main(["run", f"out={out}", "resume=true"]) == 0
    assert results(out) == results(whole)


def test_a_folder_removed_while_it_is_worked_in_is_told_and_not_made_again(wall, tmp_path, monkeypatch, capsys):
    out, save = tmp_path / "run", checkpoint.save

    def removed(*given):
        shutil.rmtree(out)
        return save(*given)

    monkeypatch.setattr(checkpoint, "save", removed)
    assert "was removed while the run worked in it" in refused(capsys, "run", *settings(wall, out))
    assert not out.exists()


def test_a_size_that_files_may_not_have_is_told_while_photos_are_matched(capture, tmp_path):
    """SQLite in COLMAP's threads would abort the process with a stack."""
    code = (
        "import resource, sys\nfrom room2dgs import cli\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, resource.RLIM_INFINITY))\nsys.exit(cli.main(sys.argv[1:]))"
    )
    argv = ["train", f"scene.path={capture}", f"out={tmp_path / 'run'}", *QUICK[1:]]
    done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("room2dgs: a file may not grow larger: ")
    assert done.stderr.endswith(f"then go on with: room2dgs train out={tmp_path / 'run'} resume=true\n")
