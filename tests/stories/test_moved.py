"""Runs whose folder, capture or working directory is another than when they were made."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
import torch

from room2dgs import owner
from room2dgs.config import load_config
from room2dgs.train import load_surfels


@pytest.fixture
def begun(room, tmp_path, story):
    """A run that is trained halfway, and its capture, in one folder."""
    here = tmp_path / "here"
    shutil.copytree(room, here / "room")
    argv = story.settings(here / "room", here / "run")
    story.told("train", *argv[1:], "train.iterations=30")
    for path in (here / "run/checkpoints").glob("*30.*"):
        path.unlink()
    (here / "run/surfels.safetensors").unlink()
    assert any((here / "run/checkpoints").iterdir())
    return here


def same_surfels(one: Path, other: Path) -> bool:
    surfels = [load_surfels(path / "surfels.safetensors") for path in (one, other)]
    return all(torch.equal(a, b) for a, b in zip(*surfels, strict=True))


def test_a_folder_that_was_moved_is_meshed_scored_and_reported_where_it_is(trained, copied, story):
    before = copied(trained, "before")
    now = before.rename(before.parent / "now")
    story.told("mesh", f"run={now}")
    story.told("eval", f"run={now}")
    story.told("render", f"run={now}")
    story.told("report", f"run={now}")
    story.told("export", f"run={now}", "to=depth")
    assert not before.exists()
    assert (now / "mesh.ply").read_bytes() == (trained / "mesh.ply").read_bytes()
    assert story.metrics(now)["f_score_5cm"] == story.metrics(trained)["f_score_5cm"]


def test_a_run_goes_on_after_it_and_its_capture_were_moved(begun, trained, story):
    there = begun.rename(begun.parent / "there")
    moved = [f"scene.path={there / 'room'}", f"points.file={there / 'room/points.ply'}"]
    story.told("run", f"out={there / 'run'}", "resume=true", *moved, f"points.cache={there / 'cache'}")
    assert same_surfels(there / "run", trained)
    assert (there / "run/mesh.ply").read_bytes() == (trained / "mesh.ply").read_bytes()
    assert load_config((), there / "run/config.yaml").scene.path == str(there / "room")
    assert not begun.exists()


def test_a_run_goes_on_from_another_working_directory(begun, trained, story, monkeypatch):
    monkeypatch.chdir(begun / "room")
    story.told("run", "out=../run", "resume=true", "scene.path=.", "points.file=points.ply")
    assert same_surfels(begun / "run", trained)
    monkeypatch.chdir("/")
    story.told("report", f"run={os.path.relpath(begun / 'run')}")


def test_a_run_does_not_go_on_with_other_photos_of_the_same_poses(begun, refused):
    photos = sorted((begun / "room/color").iterdir())
    shutil.copy(photos[1], photos[2])
    assert "trained with other photos than there are now" in refused("run", f"out={begun / 'run'}", "resume=true")


def test_a_folder_that_cannot_be_written_is_read_and_what_would_write_says_so(
    trained, copied, refused, story, tmp_path, monkeypatch
):
    kept = copied(trained)
    before = story.files(kept)
    opened = owner._opened

    def read_only(folder, flags):
        if Path(folder) == kept and flags & (os.O_RDWR | os.O_CREAT):
            raise PermissionError(13, "Permission denied")
        return opened(folder, flags)

    monkeypatch.setattr(owner, "_opened", read_only)
    for argv in (["report"], ["mesh"], ["eval"], ["render"], ["export", "to=glb"]):
        said = refused(argv[0], f"run={kept}", *argv[1:])
        assert f"{kept} cannot be written (Permission denied)" in said
    story.told("export", f"run={kept}", "to=glb,depth", f"out={tmp_path / 'elsewhere'}")
    assert (tmp_path / "elsewhere/mesh.glb").is_file()
    assert story.files(kept) == before
